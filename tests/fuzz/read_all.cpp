#include "read_all.hpp"

#include "fuzz.hpp"
#include "io/hdf5.hpp"
#include "io/replace_file.hpp"
#include "small_problems.hpp"

namespace fclib::fuzz {

namespace {

ProblemPointer pointer_to(const Problem& problem) {
  return std::visit([](const auto& p) -> ProblemPointer { return &p; }, problem);
}

/// Written and read twice, a problem gives the same file. (Once is not enough: reading drops what
/// is beyond the entries, and global matrices become triplets.)
void require_same_again(const Problem& problem, Validation validation) {
  const std::string copy = (scratch() / "copy.hdf5").string();
  const WriteOptions options{.validate = validation == Validation::full};
  write_file(copy, pointer_to(problem), nullptr, {}, options);
  const Problem again = read_problem(copy, {}, validation);
  const std::string first = read_file(copy);
  write_file(copy, pointer_to(again), nullptr, {}, options);
  require(read_file(copy) == first, "a problem that was read is written and read alike");
}

/// Vectors are equal, NaN where NaN.
bool same(const Solution& a, const Solution& b) {
  bool equal = true;
  for_each_field<Solution>([&](const auto& field) {
    const Vector& x = a.*field.member;
    const Vector& y = b.*field.member;
    equal = equal && x.size() == y.size() && (x.array() == y.array()).all();
  });
  return equal;
}

void write_into(const std::string& path) {
  Problem outline;
  if (!accepted(path, [&] { outline = read_outline(path); })) return;
  const Solution solution = std::visit([](const auto& p) { return small_solution(p); }, outline);
  if (accepted(path, [&] { write_solution(path, solution); })) {
    require(same(read_solution(path).value(), solution), "a solution is read as it was written");
  }
  if (accepted(path, [&] { write_guesses(path, {solution, solution}); })) {
    const auto guesses = read_guesses(path);
    require(guesses.size() == 2 && same(guesses[1], solution),
            "guesses are read as they were written");
  }
  accepted(path, [&] { write_int_attribute(path, "attribute", 7); });
}

}  // namespace

void read_all(const std::string& path, bool write_too) {
  Contents contents;
  const bool known = accepted(path, [&] { contents = read_contents(path); });
  std::optional<Solution> solution;
  accepted(path, [&] { solution = read_solution(path); });
  accepted(path, [&] { read_guesses(path); });

  // opening a file takes longer than all the rest: each kind by its name only where there are more
  std::vector<std::string> kinds{""};
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    if (!known || contents.kinds.size() > 1) kinds.emplace_back(P::kind);
  });
  bool readable = false;
  for (const auto validation : {Validation::full, Validation::none}) {
    for (const auto& kind : kinds) {
      Problem problem;
      if (!accepted(path, [&] { problem = read_problem(path, kind, validation); })) continue;
      readable = true;
      if (validation == Validation::full) {
        std::visit([](const auto& p) { validate(p); }, problem);
        if (solution) {
          accepted(path, [&] {
            try {
              std::visit([&](const auto& p) { validate(*solution, p); }, problem);
            } catch (const Error& error) {
              throw error.in_file(path);
            }
          });
        }
      }
      if (write_too) require_same_again(problem, validation);
    }
  }
  if (readable && write_too) write_into(path);
}

}  // namespace fclib::fuzz
