// The functions of fclib.h that read, write and free.
#include <array>
#include <atomic>
#include <cstdlib>
#include <memory>
#include <string_view>

#include "capi/errors.hpp"
#include "capi/from_c.hpp"
#include "capi/options.hpp"
#include "capi/to_c.hpp"
#include "convert/complete.hpp"
#include "io/hdf5/hdf5.hpp"

#define FCLIB_TEXT(x) #x
#define FCLIB_TEXT_OF(x) FCLIB_TEXT(x)

namespace fclib::c {

namespace {

/// The level that the environment sets. Without it, none, as in libfclib 3.1.
int first_compression() {
  const char* const named = std::getenv("FCLIB_COMPRESSION");
  const bool level = named != nullptr && *named >= '0' && *named <= '9' && named[1] == '\0';
  return level ? *named - '0' : 0;
}

// the settings of the process
std::atomic<bool> replace{false};
std::atomic<int> compression{first_compression()};
std::atomic<bool> keep_dense{false};

/// What the options of one write may say.
struct Asked {
  enum class Mode { add, replace };
  Mode mode = replace ? Mode::replace : Mode::add;
  int compression = c::compression;

  static constexpr std::array<std::string_view, 2> modes{"add", "replace"};
  static constexpr auto fields() {
    using A = Asked;
    return std::tuple{
        OptionField<A, Mode>{.name = "mode", .member = &A::mode, .choices = modes},
        OptionField<A, int>{
            .name = "compression", .member = &A::compression, .lowest = 0, .highest = 9},
    };
  }
};

template <class C>
int write_problem(const C* c, const char* path, const fclib_options* asked) {
  return guarded(0, [&] {
    const ProblemView problem = view_as_given(given(c, "problem"));
    WriteOptions options = write_options(asked);
    options.append = true;
    write_file(&given(path, "path"), problem, options);
    return 1;
  });
}

template <class C>
C* read_c(const char* path) {
  return guarded<C*>(nullptr, [&] {
    using P = CoreOf<C>;
    RawProblem problem = read_raw_problem(&given(path, "path"), P::kind);
    return to_c<C>(problem, keep_dense);
  });
}

/// If a solution lacks v or u, they follow from r and l, if the problem in the file allows it.
/// Anything else that the caller's solution lacks is zero, as in 3.1.
Solution completed(Solution solution, const Problem& outline, const char* path, bool with_zeros) {
  return std::visit(
      [&]<class P>(const P& sizes) {
        const auto lacks = [&](const Vector& values, Dim rows) {
          return values.size() == 0 && sizes.size(rows) > 0;
        };
        if ((lacks(solution.u, Dim::m) || lacks(solution.v, Dim::n)) &&
            !lacks(solution.r, Dim::m) && !lacks(solution.l, Dim::p)) {
          try {
            solution = complete(std::get<P>(read_problem(path, P::kind)), std::move(solution));
          } catch (const Error&) {
            // 3.1 also takes solutions of problems that make no sense
          }
        }
        for_each_member<fclib_solution>([&](const auto& field, double* fclib_solution::*) {
          Vector& values = solution.*field.member;
          if (with_zeros && lacks(values, field.rows)) {
            values = Vector::Zero(sizes.size(field.rows));
          }
        });
        return std::move(solution);
      },
      outline);
}

Solution completed(const fclib_solution& c, const Problem& outline, const char* path) {
  Solution given_parts =
      std::visit([&](const auto& sizes) { return solution_of(c, sizes, Parts::any); }, outline);
  return completed(std::move(given_parts), outline, path, true);
}

template <class C>
void delete_members(C* c) {
  if (c == nullptr) return;
  free_members(*c);
  *c = C{};
}

int write_one_solution(const fclib_solution* solution, const char* path,
                       const fclib_options* options) {
  return guarded(0, [&] {
    const Problem outline = read_outline(&given(path, "path"));
    write_solution(path, completed(given(solution, "solution"), outline, path),
                   write_options(options));
    return 1;
  });
}

int write_all_guesses(int number_of_guesses, const fclib_solution* guesses, const char* path,
                      const fclib_options* options) {
  return guarded(0, [&] {
    const Problem outline = read_outline(&given(path, "path"));
    const std::size_t count = size_of(number_of_guesses, "number_of_guesses");
    if (count > 0) given(guesses, "guesses");
    std::vector<Solution> all;
    for (std::size_t k = 0; k < count; ++k) all.push_back(completed(guesses[k], outline, path));
    write_guesses(path, all, write_options(options));
    return 1;
  });
}

}  // namespace

// 3.1 checks no value and converts no matrix
WriteOptions write_options(const fclib_options* options) {
  Asked asked;
  if (options != nullptr) {
    for (const auto& [name, value] : options->values) {
      if (name == "mode" || name == "compression") continue;
      fail("options", "a write has no option '" + name + "'; it has: mode, compression");
    }
    if (!options->arrays.empty()) fail("options", "a write takes no array");
    // what the options do not set is as in the process
    OptionValues values{
        {"mode", std::string(Asked::modes.at(static_cast<std::size_t>(asked.mode)))},
        {"compression", std::int64_t{asked.compression}}};
    for (const auto& [name, value] : options->values) values[name] = value;
    asked = parse_options<Asked>(values);
  }
  return {.validate = false,
          .replace = asked.mode == Asked::Mode::replace,
          .compression = asked.compression};
}

}  // namespace fclib::c

using namespace fclib;
using namespace fclib::c;

extern "C" {

#define FCLIB_FUNCTIONS_OF(kind)                                                           \
  int fclib_write_##kind(fclib_##kind* problem, const char* path) {                        \
    return write_problem(problem, path, nullptr);                                          \
  }                                                                                        \
  int fclib_write_##kind##_with(const fclib_##kind* problem, const char* path,             \
                                const fclib_options* options) {                            \
    return write_problem(problem, path, options);                                          \
  }                                                                                        \
  fclib_##kind* fclib_read_##kind(const char* path) { return read_c<fclib_##kind>(path); } \
  void fclib_delete_##kind(fclib_##kind* problem) { delete_members(problem); }

FCLIB_FOR_EACH_KIND(FCLIB_FUNCTIONS_OF)

#undef FCLIB_FUNCTIONS_OF

int fclib_write_solution(fclib_solution* solution, const char* path) {
  return write_one_solution(solution, path, nullptr);
}

int fclib_write_solution_with(const fclib_solution* solution, const char* path,
                              const fclib_options* options) {
  return write_one_solution(solution, path, options);
}

int fclib_write_guesses(int number_of_guesses, fclib_solution* guesses, const char* path) {
  return write_all_guesses(number_of_guesses, guesses, path, nullptr);
}

int fclib_write_guesses_with(int number_of_guesses, const fclib_solution* guesses, const char* path,
                             const fclib_options* options) {
  return write_all_guesses(number_of_guesses, guesses, path, options);
}

fclib_solution* fclib_read_solution(const char* path) {
  return guarded<fclib_solution*>(nullptr, [&] {
    Problem outline;
    auto solution = read_solution(&given(path, "path"), &outline);
    if (!solution) throw Error(ErrorKind::file, "holds no solution", "/", path);
    Owned<fclib_solution> c(allocate<fclib_solution>(1));
    to_c(completed(std::move(*solution), outline, path, false), outline,
         std::string(path) + ": /solution", *c);
    return c.release();
  });
}

fclib_solution* fclib_read_guesses(const char* path, int* number_of_guesses) {
  if (number_of_guesses != nullptr) *number_of_guesses = 0;
  return guarded<fclib_solution*>(nullptr, [&] {
    int& number = given(number_of_guesses, "number_of_guesses");
    Problem outline;
    auto guesses = read_guesses(&given(path, "path"), &outline);
    if (guesses.empty()) return static_cast<fclib_solution*>(nullptr);  // no error, as in 3.1
    const int count = static_cast<int>(guesses.size());
    const auto release = [&](fclib_solution* array) { fclib_delete_solutions(array, count); };
    std::unique_ptr<fclib_solution, decltype(release)> array(
        allocate<fclib_solution>(guesses.size()), release);
    for (std::size_t k = 0; k < guesses.size(); ++k) {
      to_c(completed(std::move(guesses[k]), outline, path, false), outline,
           std::string(path) + ": /guesses/" + std::to_string(k + 1), array.get()[k]);
    }
    number = count;
    return array.release();
  });
}

void fclib_delete_solutions(fclib_solution* data, int count) {
  if (data == nullptr) return;
  for (int k = 0; k < count; ++k) free_members(data[k]);
  std::free(data);
}

int fclib_create_int_attributes_in_info(const char* path, const char* attr_name, int attr_value) {
  return guarded(0, [&] {
    write_int_attribute(&given(path, "path"), &given(attr_name, "attr_name"), attr_value,
                        write_options(nullptr));
    return 1;
  });
}

const char* fclib_problem_kind(const char* path) {
  return guarded<const char*>(nullptr, [&] {
    const Problem outline = read_outline(&given(path, "path"));
    // the kinds are string literals
    return std::visit([]<class P>(const P&) { return P::kind.data(); }, outline);
  });
}

int fclib_problem_sizes(const char* path, int* n, int* m, int* p, int* nc) {
  return guarded(0, [&] {
    const Problem outline = read_outline(&given(path, "path"));
    std::visit(
        [&](const auto& sizes) {
          const auto tell = [&](int* place, Dim dim) {
            if (place != nullptr) *place = sizes.size(dim);
          };
          tell(n, Dim::n);
          tell(m, Dim::m);
          tell(p, Dim::p);
          tell(nc, Dim::nc);
        },
        outline);
    return 1;
  });
}

int fclib_set_write_mode(fclib_write_mode mode) {
  return guarded(0, [&] {
    const int number = number_of(mode);
    if (number != FCLIB_WRITE_ADD && number != FCLIB_WRITE_REPLACE) {
      fail("write mode", std::to_string(number) + " is none");
    }
    replace = number == FCLIB_WRITE_REPLACE;
    return 1;
  });
}

int fclib_set_compression(int level) {
  return guarded(0, [&] {
    if (level < 0 || level > 9) {
      fail("compression level", std::to_string(level) + " is not in 0..9");
    }
    compression = level;
    return 1;
  });
}

const char* fclib_version(void) {
  return FCLIB_TEXT_OF(FCLIB_VERSION_MAJOR) "." FCLIB_TEXT_OF(
      FCLIB_VERSION_MINOR) "." FCLIB_TEXT_OF(FCLIB_VERSION_PATCH);
}

int fclib_keep_dense(int keep) {
  forget_error();
  keep_dense = keep != 0;
  return 1;
}

}  // extern "C"
