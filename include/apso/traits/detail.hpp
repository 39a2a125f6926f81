/// \file
/// What all traits headers share. Not meant to be included by users.
#pragma once

#include <type_traits>
#include <utility>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN
namespace detail {

template <class From, class To>
inline constexpr bool converts_v = std::is_convertible_v<From, To>;

/// detected_v<Op, T>: the expression type Op<T> exists.
template <class Void, template <class...> class Op, class... A>
struct detected : std::false_type {};
template <template <class...> class Op, class... A>
struct detected<std::void_t<Op<A...>>, Op, A...> : std::true_type {};
template <template <class...> class Op, class... A>
inline constexpr bool detected_v = detected<void, Op, A...>::value;

/// detected_as_v<To, Op, T>: the expression exists and its type converts to To.
template <class To, class Void, template <class...> class Op, class... A>
struct detected_as : std::false_type {};
template <class To, template <class...> class Op, class... A>
struct detected_as<To, std::void_t<Op<A...>>, Op, A...> : std::is_convertible<Op<A...>, To> {};
template <class To, template <class...> class Op, class... A>
inline constexpr bool detected_as_v = detected_as<To, void, Op, A...>::value;

}  // namespace detail
APSO_NAMESPACE_END
