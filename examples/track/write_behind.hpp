/// \file
/// Files written on another thread while the next frame is at work.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>

namespace track {

/// Does jobs in their order. What a job throws is thrown by the next add() or finish(); the jobs after it are still done.
class WriteBehind {
 public:
  /// \param thread false: every job is done at once
  explicit WriteBehind(bool thread) {
    if (thread) thread_ = std::thread([this] { work(); });
  }
  /// What is waiting is still done.
  ~WriteBehind() {
    {
      const std::lock_guard lock(mutex_);
      ended_ = true;
    }
    changed_.notify_all();
    if (thread_.joinable()) thread_.join();
  }
  WriteBehind(const WriteBehind&) = delete;
  WriteBehind& operator=(const WriteBehind&) = delete;

  /// Waits while there are too many.
  /// \param job must not refer to anything that changes before it is done
  void add(std::function<void()> job) {
    if (!thread_.joinable()) return job();
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return jobs_.size() < most || failure_; });
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
    jobs_.push_back(std::move(job));
    changed_.notify_all();
  }

  /// Waits until all is done.
  void finish() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return jobs_.empty(); });
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
  }

 private:
  static constexpr std::size_t most = 8;  // waiting; each may hold a picture

  void work() {
    std::unique_lock lock(mutex_);
    for (;;) {
      changed_.wait(lock, [this] { return !jobs_.empty() || ended_; });
      if (jobs_.empty()) return;
      const std::function<void()>& job = jobs_.front();
      lock.unlock();
      std::exception_ptr failure;
      try {
        job();
      } catch (...) {
        failure = std::current_exception();
      }
      lock.lock();
      jobs_.pop_front();  // not before: finish() waits for this
      if (failure && !failure_) failure_ = failure;
      changed_.notify_all();
    }
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> jobs_;
  std::exception_ptr failure_;
  bool ended_ = false;
  std::thread thread_;
};

}  // namespace track
