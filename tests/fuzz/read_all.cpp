#include "read_all.hpp"

#include "fuzz.hpp"
#include "io/hdf5/hdf5.hpp"
#include "io/replace_file.hpp"
#include "small_problems.hpp"

namespace fclib::fuzz {

namespace {

ProblemPointer pointer_to(const Problem& problem) {
  return std::visit([](const auto& p) -> ProblemPointer { return &p; }, problem);
}

/// Written and read twice, a problem gives the same file. (Once is not enough: reading drops what
/// is beyond the entries, and global matrices become triplets.)
void require_same_again(const Problem& problem) {
  const std::string copy = (scratch() / "copy.hdf5").string();
  write_file(copy, pointer_to(problem));
  const Problem again = read_problem(copy);
  const std::string first = read_file(copy);
  write_file(copy, pointer_to(again));
  require(read_file(copy) == first, "a problem that was read is written and read alike");
}

/// Every number of a matrix is there, and there are as many as its storage needs.
void touch(RawMatrix& a) {
  const auto rows = static_cast<std::size_t>(a.rows);
  const auto cols = static_cast<std::size_t>(a.cols);
  const bool dense = a.storage == Storage::dense;
  const bool triplet = a.storage == Storage::triplet;
  const std::size_t pointers = triplet ? a.x.size() : (a.storage == Storage::csc ? cols : rows) + 1;
  require(dense || a.p.size() == pointers, "a matrix has all its pointers");
  require(a.x.size() == (dense ? rows * cols : a.i.size()), "a matrix has all its entries");
  double sum = 0;
  for (std::size_t k = 0; k < a.p.size(); ++k) sum += a.p[k];
  for (std::size_t k = 0; k < a.i.size(); ++k) sum += a.i[k];
  for (std::size_t k = 0; k < a.x.size(); ++k) sum += a.x[k];
  [[maybe_unused]] static volatile double used = 0;
  used = sum;
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

constexpr std::int64_t most_entries = 1 << 20;  // of a solution that is written into a file

constexpr const char* attributed[] = {"solution", "info"};  // groups

void write_into(const std::string& path) {
  Problem outline;
  if (!accepted(path, [&] { outline = read_outline(path); })) return;
  // an outline has the sizes that a file claims, without the data: no solution of gigabytes for it
  if (std::visit([](const auto& p) { return length_of_solution(p); }, outline) > most_entries)
    return;
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
  for (const char* group : attributed) {
    const Attributes told{{"attribute", 0.5}, {"word", std::string("some text")}};
    if (!accepted(path, [&] { write_attributes(path, group, told); })) continue;
    const Attributes again = read_attributes(path, group);
    for (const auto& [name, value] : told) {
      require(again.contains(name) && again.at(name) == value,
              "attributes are read as they were written");
    }
  }
}

}  // namespace

void read_all(const std::string& path, bool write_too) {
  Contents contents;
  const bool known = accepted(path, [&] { contents = read_contents(path); });
  std::optional<Solution> solution;
  accepted(path, [&] { solution = read_solution(path); });
  accepted(path, [&] { read_guesses(path); });
  for (const char* group : attributed) accepted(path, [&] { read_attributes(path, group); });

  // opening a file takes longer than all the rest: each kind by its name only where there are more
  std::vector<std::string> kinds{""};
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    if (!known || contents.kinds.size() > 1) kinds.emplace_back(P::kind);
  });
  bool readable = false;
  for (const auto& kind : kinds) {
    RawProblem raw;
    if (accepted(path, [&] { raw = read_raw_problem(path, kind); })) {
      readable = true;
      for (auto& member : raw.members) {
        if (auto* a = std::get_if<RawMatrix>(&member.value)) touch(*a);
      }
    }
    Problem problem;
    if (!accepted(path, [&] { problem = read_problem(path, kind); })) continue;
    readable = true;
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
    if (write_too) require_same_again(problem);
  }
  if (readable && write_too) write_into(path);
}

}  // namespace fclib::fuzz
