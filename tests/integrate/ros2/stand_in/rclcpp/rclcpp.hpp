// Stand-in of the part of rclcpp that the node uses, for machines without ROS 2: topics are called at once, in one process.
#pragma once

#include <any>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace rclcpp {

struct QoS {};
struct SensorDataQoS : QoS {
  SensorDataQoS() {}
};

/// What a test sees of the world outside of the node.
struct Bus {
  static Bus& get() {
    static Bus bus;
    return bus;
  }
  std::map<std::string, std::any> subscriptions;  // topic -> std::function<void(shared_ptr<const M>)>
  std::map<std::string, std::any> published;      // topic -> std::vector<M>
  std::vector<std::string> errors;
  std::map<std::string, std::any> parameters;  // overrides

  template <class M>
  void send(const std::string& topic, const M& m) {
    std::any_cast<std::function<void(std::shared_ptr<const M>)>>(subscriptions.at(topic))(std::make_shared<const M>(m));
  }
  template <class M>
  const std::vector<M>& sent(const std::string& topic) {
    std::any& all = published[topic];
    if (!all.has_value()) all = std::vector<M>{};
    return *std::any_cast<std::vector<M>>(&all);
  }
};

template <class M>
class Publisher {
 public:
  using SharedPtr = std::shared_ptr<Publisher<M>>;
  explicit Publisher(std::string topic) : topic_(std::move(topic)) {}
  void publish(const M& m) {
    Bus::get().sent<M>(topic_);
    std::any_cast<std::vector<M>>(&Bus::get().published[topic_])->push_back(m);
  }

 private:
  std::string topic_;
};

template <class M>
class Subscription {
 public:
  using SharedPtr = std::shared_ptr<Subscription<M>>;
};

struct Logger {};

class Node {
 public:
  explicit Node(std::string name) : name_(std::move(name)) {}
  virtual ~Node() = default;
  template <class T>
  T declare_parameter(const std::string& name, const T& value) {
    const auto found = Bus::get().parameters.find(name);
    return found == Bus::get().parameters.end() ? value : std::any_cast<T>(found->second);
  }
  template <class M>
  typename Publisher<M>::SharedPtr create_publisher(const std::string& topic, int) {
    return std::make_shared<Publisher<M>>(topic);
  }
  template <class M, class Callback>
  typename Subscription<M>::SharedPtr create_subscription(const std::string& topic, const QoS&, Callback callback) {
    Bus::get().subscriptions[topic] = std::function<void(std::shared_ptr<const M>)>(callback);
    return std::make_shared<Subscription<M>>();
  }
  Logger get_logger() const { return {}; }

 private:
  std::string name_;
};

inline void init(int, char**) {}
inline void spin(const std::shared_ptr<Node>&) {}
inline void shutdown() {}

template <class... A>
void log_error(const Logger&, const char* format, A... arguments) {
  char text[500];
  std::snprintf(text, sizeof text, format, arguments...);
  Bus::get().errors.emplace_back(text);
}

}  // namespace rclcpp

#define RCLCPP_ERROR(...) ::rclcpp::log_error(__VA_ARGS__)
