#include "capi/errors.hpp"

#include <cstdio>
#include <mutex>

#include "capi/structs.hpp"
#include "error.hpp"

namespace fclib::c {

namespace {

thread_local std::string last_error;

/// Clients of 3.1 do not check results: that library printed errors on the standard error.
void print(const char* message, void*) { std::fprintf(stderr, "fclib: %s\n", message); }

struct Handler {
  fclib_error_handler function = print;
  void* context = nullptr;
};

std::mutex handler_mutex;
Handler handler;

}  // namespace

void report(const char* message) noexcept {
  try {
    last_error = message;
    Handler current;
    {
      const std::lock_guard lock(handler_mutex);
      current = handler;
    }
    // a copy: the handler may call the library
    const std::string text = last_error;
    if (current.function != nullptr) {
      current.function(text.c_str(), current.context);
      last_error = text;
    }
  } catch (...) {
    // a C++ handler threw, or there is no memory for the message: nobody is left to tell
    last_error.clear();
  }
}

void forget_error() noexcept { last_error.clear(); }

void fail(const Place& where, const std::string& message) {
  throw Error(ErrorKind::problem, message, where);
}

}  // namespace fclib::c

using namespace fclib::c;

extern "C" {

const char* fclib_last_error(void) { return last_error.c_str(); }

void fclib_set_error(const char* message) {
  report(message != nullptr ? message : "message: is NULL");
}

void fclib_set_error_handler(fclib_error_handler function, void* context) {
  const std::lock_guard lock(handler_mutex);
  handler = {function, context};
}

}  // extern "C"
