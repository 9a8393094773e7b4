// What a file holds, and how large its problems are.
#pragma once

#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "io/hdf5/read.hpp"
#include "io/hdf5/read_objects.hpp"
#include "problem.hpp"

namespace fclib::hdf5 {

std::vector<std::string> kinds_of(const Group& root);

/// Throws because a file holds no problem, and says what it holds instead.
[[noreturn]] void fail_without_problem(const Group& root, const std::string& more = {});

/// A group of numbered solutions, and the number that says how many.
struct Numbered {
  const char* group;
  const char* count;
};
constexpr Numbered guesses_list{"guesses", "number_of_guesses"};
constexpr Numbered solutions_list{"solutions", "number_of_solutions"};

/// Whether there is a solution. A group whose reactions were never written is not one.
bool has_solution(const Group& root);

/// How many entries a list has; 0 if there is no list.
Index count_of(const Group& root, const Numbered& list);

/// If a solution or a list cannot be read, its problem can still be read.
Contents contents_of(const Group& root);

/// The kind of the problem that a solution of the file belongs to.
std::string owner_of(const std::vector<std::string>& kinds, std::string_view preferred = "global");
/// ... of a file. Throws if it holds no problem.
std::string owner_of(const Group& root, std::string_view preferred = "global");

/// The sizes of that problem.
Problem outline_of(const Group& root);

/// Calls visit(field, place) for each field that the group of a formulation has. `place` has the
/// group in which the field lies.
template <class P, class Visitor>
void for_each_stored_field(const Group& group, const Visitor& visit) {
  const Handle vectors_handle = open_group(group, "vectors");
  const Group vectors{vectors_handle.id(), group.child("vectors")};
  for_each_field<P>([&]<class Member>(const Field<P, Member>& field) {
    const Group& place = std::is_same_v<Member, Vector> ? vectors : group;
    if (field.presence == Presence::required || place.has(std::string(field.name))) {
      visit(field, place);
    }
  });
}

/// The sizes of a matrix; A is Matrix or RawMatrix.
template <class A>
A read_matrix_sizes(const Group& group) {
  A a;
  a.rows = read_number<Index>(group, "m");
  a.cols = read_number<Index>(group, "n");
  if (a.rows < 0) fail(group.child("m"), "is negative");
  if (a.cols < 0) fail(group.child("n"), "is negative");
  return a;
}

/// Makes mu as long as the matrices say, if it has that length in the file.
template <class P>
void require_contacts(P& outline, std::size_t stored) {
  if (static_cast<std::size_t>(contact_count(outline)) != stored) {
    detail::require_size(static_cast<Index>(stored), contact_count(outline), Dim::nc,
                         "/" + group_name<P>() + "/vectors/mu", "entries");
  }
  count_contacts(outline);
}

}  // namespace fclib::hdf5
