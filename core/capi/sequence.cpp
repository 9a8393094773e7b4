// fclib_sequence_...: many problems in one file.
#include "io/hdf5/sequence.hpp"

#include <limits>
#include <memory>
#include <optional>

#include "capi/errors.hpp"
#include "capi/from_c.hpp"
#include "capi/geometry_of_c.hpp"
#include "capi/options.hpp"
#include "problem.hpp"

/// A sequence that is written, and the sizes of the problem of its last step.
struct fclib_sequence {
  fclib::SequenceWriter writer;
  std::optional<fclib::Problem> outline;

  fclib_sequence(const char* path, const fclib::SequenceOptions& options) : writer(path, options) {}
};

namespace fclib::c {

namespace {

/// The sizes of a problem that is written.
template <class P>
P outline_of(const ProblemView& view) {
  P outline;
  for (const ProblemView::Member& member : view.members) {
    for_each_field<P>([&]<class Type>(const Field<P, Type>& field) {
      if (field.name != member.name) return;
      if constexpr (std::is_same_v<Type, Matrix>) {
        const auto& a = std::get<RawMatrixView>(member.value);
        (outline.*field.member).rows = a.rows;
        (outline.*field.member).cols = a.cols;
      } else if constexpr (std::is_same_v<Type, Index>) {
        outline.*field.member = std::get<Index>(member.value);
      }
    });
  }
  count_contacts(outline);
  return outline;
}

template <class C>
int add_problem(fclib_sequence* sequence, const C* problem, int world) {
  return guarded(0, [&] {
    fclib_sequence& own = given(sequence, "sequence");
    own.outline.reset();
    own.writer.end_step();  // also if this problem is refused
    const C& c = given(problem, "problem");
    const ProblemView view = view_as_given(c);
    own.writer.add(view, world);
    own.outline = outline_of<CoreOf<C>>(view);
    return 1;
  });
}

/// How many steps a file has. Throws if it is no sequence.
std::size_t require_steps(const char* path) {
  const auto steps = read_steps(path);
  if (!steps) throw Error(ErrorKind::file, "is no sequence", "/", path);
  return steps->size();
}

/// The sizes of the problem of the step.
const Problem& outline_of(const fclib_sequence& sequence) {
  if (!sequence.outline) fail("sequence", "has no step to add to: its problem comes first");
  return *sequence.outline;
}

Solution solution_in(const fclib_sequence& sequence, const fclib_solution& c) {
  return std::visit([&](const auto& sizes) { return solution_of(c, sizes, Parts::some); },
                    outline_of(sequence));
}

}  // namespace

}  // namespace fclib::c

using namespace fclib;
using namespace fclib::c;

extern "C" {

fclib_sequence* fclib_sequence_create(const char* path, const fclib_options* options) {
  return guarded<fclib_sequence*>(nullptr, [&] {
    const WriteOptions asked = write_options(options);
    return new fclib_sequence(&given(path, "path"), {.compression = asked.compression});
  });
}

fclib_sequence* fclib_sequence_continue(const char* path) {
  return guarded<fclib_sequence*>(nullptr, [&] {
    require_steps(&given(path, "path"));
    return new fclib_sequence(path, {.append = true});
  });
}

#define FCLIB_FUNCTIONS_OF(kind)                                                       \
  int fclib_sequence_add_##kind(fclib_sequence* sequence, const fclib_##kind* problem, \
                                int world) {                                           \
    return add_problem(sequence, problem, world);                                      \
  }

FCLIB_FOR_EACH_KIND(FCLIB_FUNCTIONS_OF)

#undef FCLIB_FUNCTIONS_OF

int fclib_sequence_add_solution(fclib_sequence* sequence, const fclib_solution* solution) {
  return guarded(0, [&] {
    fclib_sequence& own = given(sequence, "sequence");
    own.writer.add_solution(solution_in(own, given(solution, "solution")));
    return 1;
  });
}

int fclib_sequence_add_guesses(fclib_sequence* sequence, int number_of_guesses,
                               const fclib_solution* guesses) {
  return guarded(0, [&] {
    fclib_sequence& own = given(sequence, "sequence");
    const std::size_t count = size_of(number_of_guesses, "number_of_guesses");
    if (count > 0) given(guesses, "guesses");
    std::vector<Solution> all;
    for (std::size_t k = 0; k < count; ++k) all.push_back(solution_in(own, guesses[k]));
    own.writer.add_guesses(all);
    return 1;
  });
}

int fclib_sequence_add_geometry(fclib_sequence* sequence, const fclib_geometry* geometry) {
  return guarded(0, [&] {
    fclib_sequence& own = given(sequence, "sequence");
    const Geometry tables = geometry_of_c(given(geometry, "geometry"));
    const Index contacts =
        std::visit([](const auto& p) { return p.size(Dim::nc); }, outline_of(own));
    detail::require_size(geometry->nc, contacts, Dim::nc, "/contacts", "rows");
    own.writer.add_geometry(tables);
    return 1;
  });
}

int fclib_sequence_flush(fclib_sequence* sequence) {
  return guarded(0, [&] {
    given(sequence, "sequence").writer.flush();
    return 1;
  });
}

int fclib_sequence_close(fclib_sequence* sequence) {
  return guarded(0, [&] {
    if (sequence == nullptr) return 1;
    const std::unique_ptr<fclib_sequence> last(sequence);
    last->writer.close();
    return 1;
  });
}

int fclib_sequence_size(const char* path) {
  return guarded(-1, [&] {
    const std::size_t steps = require_steps(&given(path, "path"));
    if (steps > static_cast<std::size_t>(std::numeric_limits<int>::max())) {
      throw Error(ErrorKind::file, "has more steps than an int counts", "/", path);
    }
    return static_cast<int>(steps);
  });
}

}  // extern "C"
