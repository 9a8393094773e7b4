#include "io/hdf5/contents.hpp"

#include <algorithm>

#include "io/hdf5/stored_sequence.hpp"

namespace fclib::hdf5 {

std::vector<std::string> kinds_of(const Group& root) {
  std::vector<std::string> kinds;
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    if (root.has(group_name<P>())) kinds.emplace_back(P::kind);
  });
  return kinds;
}

void fail_without_problem(const Group& root, const std::string& more) {
  if (root.has(sequence_group)) {
    if (StoredSequence(root).size() == 0) fail("/", "is a sequence in which there is no step");
    fail("/", "is a sequence of many problems: name one of them by FILE#NUMBER, the first is #0");
  }
  fail("/", "holds no problem in a known FCLIB layout" + more);
}

bool has_solution(const Group& root) {
  if (!root.has("solution")) return false;
  const Handle group(H5Gopen2(root.id, "solution", H5P_DEFAULT), H5Gclose);
  return !group.ok() || !is_unwritten({group.id(), root.child("solution")}, "r");
}

Index count_of(const Group& root, const Numbered& list) {
  if (!root.has(list.group)) return 0;
  const Handle handle = open_group(root, list.group);
  const Group group{handle.id(), root.child(list.group)};
  const auto count = read_number<Index>(group, list.count);
  if (count < 0) fail(group.child(list.count), "is negative");
  return count;
}

namespace {

/// What `read` returns, or this if it fails.
template <class Value, class Read>
Value value_or(Value otherwise, const Read& read) {
  try {
    return read();
  } catch (const Error&) {
    return otherwise;
  }
}

}  // namespace

Contents contents_of(const Group& root) {
  Contents contents;
  contents.kinds = kinds_of(root);
  contents.solution = value_or(true, [&] { return has_solution(root); });
  contents.guesses = value_or(0, [&] { return count_of(root, guesses_list); });
  contents.solutions = value_or(0, [&] { return count_of(root, solutions_list); });
  return contents;
}

std::string owner_of(const std::vector<std::string>& kinds, std::string_view preferred) {
  const bool found = std::find(kinds.begin(), kinds.end(), preferred) != kinds.end();
  return found ? std::string(preferred) : kinds.front();
}

std::string owner_of(const Group& root, std::string_view preferred) {
  const std::vector<std::string> kinds = kinds_of(root);
  if (kinds.empty()) fail_without_problem(root, "; it must come first");
  return owner_of(kinds, preferred);
}

namespace {

template <class P>
P read_sizes(const Group& root) {
  const Handle handle = open_group(root, group_name<P>());
  const Group group{handle.id(), root.child(group_name<P>())};
  P problem;
  std::size_t contacts = 0;
  for_each_stored_field<P>(
      group, [&]<class Member>(const Field<P, Member>& field, const Group& place) {
        const std::string name(field.name);
        if constexpr (std::is_same_v<Member, Vector>) {
          if (field.member == &P::mu) contacts = open_numbers(place, name).size;
        } else if constexpr (std::is_same_v<Member, Matrix>) {
          const Handle matrix = open_group(place, name);
          problem.*field.member = read_matrix_sizes<Matrix>({matrix.id(), place.child(name)});
        } else {
          problem.*field.member = read_number<Member>(place, name);
        }
      });
  require_contacts(problem, contacts);
  return problem;
}

}  // namespace

Problem outline_of(const Group& root) {
  const std::string owner = owner_of(root);
  Problem problem;
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    if (owner == P::kind) problem = read_sizes<P>(root);
  });
  return problem;
}

}  // namespace fclib::hdf5
