// Errors on their way to C: no exception leaves the library, and the message is kept.
#pragma once

#include <cstring>
#include <exception>
#include <new>
#include <string>

#include "place.hpp"

namespace fclib::c {

/// Keeps a message for fclib_last_error(), and calls the handler.
void report(const char* message) noexcept;
/// A function that succeeds leaves no message.
void forget_error() noexcept;

/// What body() returns, or `failure` with the message kept.
template <class Result, class Body>
Result guarded(Result failure, const Body& body) noexcept {
  forget_error();
  try {
    return body();
  } catch (const std::bad_alloc&) {
    report("there is not enough memory");
  } catch (const std::exception& error) {
    report(error.what());
  } catch (...) {
    report("an unknown error");
  }
  return failure;
}

/// Throws Error (problem).
[[noreturn]] void fail(const Place& where, const std::string& message);

/// What a pointer of the caller points to. The name is not a reference: GCC 14 would warn that the
/// result may refer to it.
template <class T>
T& given(T* pointer, Place name) {
  if (pointer == nullptr) fail(name, "is NULL");
  return *pointer;
}

/// A constant of the caller, who may pass any number. If the number is no value of the enum, C++
/// does not allow to read it as one.
template <class Enum>
int number_of(const Enum& constant) {
  static_assert(sizeof(Enum) == sizeof(int));
  int number;
  std::memcpy(&number, &constant, sizeof number);
  return number;
}

}  // namespace fclib::c
