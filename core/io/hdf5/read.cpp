#include "io/hdf5/read.hpp"

#include <algorithm>
#include <optional>
#include <span>
#include <utility>
#include <variant>

#include "io/hdf5/contents.hpp"
#include "io/hdf5/geometry_groups.hpp"
#include "io/hdf5/open.hpp"
#include "io/hdf5/raw.hpp"
#include "linalg/places.hpp"

namespace fclib {

using namespace hdf5;

namespace {

/// Lines about what was left out, each with its place.
using LeftOut = std::vector<std::string>;

template <class Values>
void shorten(Values& values, std::size_t length, const std::string& where) {
  if (values.size() < length) {
    fail(where,
         "has " + std::to_string(values.size()) + " entries, expected " + std::to_string(length));
  }
  if constexpr (requires { values.shorten(length); }) {
    values.shorten(length);
  } else {
    values.resize(length);
  }
}

/// The matrix of which a file may have one triangle. The attribute of the public contact-scene-v1
/// packages tells.
constexpr const char* packed_mark = "symmetric_packed";

bool is_packed(const Group& group) {
  if (H5Aexists(group.id, packed_mark) <= 0) return false;
  const std::string where = group.path + ", attribute " + packed_mark;
  const Handle attribute(H5Aopen(group.id, packed_mark, H5P_DEFAULT), H5Aclose);
  const Handle space(H5Aget_space(attribute.id()), H5Sclose);
  const Handle type(H5Aget_type(attribute.id()), H5Tclose);
  const H5T_class_t kind = H5Tget_class(type.id());
  const bool number = kind == H5T_INTEGER || kind == H5T_FLOAT || kind == H5T_ENUM;
  double value = 0;
  if (!number || H5Sget_simple_extent_npoints(space.id()) != 1 ||
      H5Aread(attribute.id(), H5T_NATIVE_DOUBLE, &value) < 0 || (value != 0 && value != 1)) {
    fail(where, "is not a number: expected 1 for one triangle of a symmetric matrix, or 0");
  }
  return value == 1;
}

/// Runs a read that a problem can do without. If it fails, the thing is left out.
template <class Read>
void read_if_possible(LeftOut* left_out, const Read& read) {
  try {
    read();
  } catch (const Error& error) {
    if (left_out != nullptr) left_out->push_back(error.what());
  }
}

std::optional<MatrixInfo> read_matrix_info(const Group& group, const std::string& otherwise,
                                           LeftOut* left_out) {
  MatrixInfo info{.comment = otherwise};
  bool known = false;
  for_each_field<MatrixInfo>([&]<class Member>(const Field<MatrixInfo, Member>& field) {
    read_if_possible(left_out, [&] {
      const std::string name(field.name);
      if (!group.has(name)) return;
      if constexpr (std::is_same_v<Member, std::string>) {
        info.*field.member = read_text(group, name);
      } else {
        info.*field.member = read_number<Member>(group, name);
      }
      known = true;
    });
  });
  return known ? std::optional(info) : std::nullopt;
}

template <class Values>
std::span<const double> span_of(Values& values) {
  return {values.data(), values.size()};
}

/// Notes entries that no pointer and no count refers to. CSparse has such room, with anything in
/// it.
void note_uncounted(const std::vector<double>& x, std::size_t counted, const Group& group,
                    LeftOut* left_out) {
  if (left_out == nullptr || counted >= x.size()) return;
  const auto first = x.begin() + static_cast<std::ptrdiff_t>(counted);
  if (std::all_of(first, x.end(), [](double value) { return value == 0; })) return;
  left_out->push_back(group.child("x") + ": has " + std::to_string(x.size()) +
                      " entries, of which " + std::to_string(counted) + " are counted");
}

template <class A>
A read_matrix(const Group& parent, const std::string& name, LeftOut* left_out) {
  constexpr bool raw = std::is_same_v<A, RawMatrix>;
  const Handle handle = open_group(parent, name);
  const Group group{handle.id(), parent.child(name)};
  const std::string otherwise = raw ? absent_text : std::string();
  if (is_packed(group)) {
    if constexpr (raw) {
      Matrix whole = read_matrix<Matrix>(parent, name, left_out);
      whole.info = read_matrix_info(group, otherwise, nullptr);
      return raw_copy(whole);
    }
  }
  A a = read_matrix_sizes<A>(group);
  const auto rows = static_cast<std::size_t>(a.rows);
  const auto cols = static_cast<std::size_t>(a.cols);
  const Index nz = read_number<Index>(group, "nz");
  const auto read_entries = [&] { a.x = read_doubles<decltype(a.x)>(group, "x"); };
  if (nz == nz_dense) {
    a.storage = Storage::dense;
    if (group.has("x") && !open_numbers(group, "x").flat) {
      fail(group.child("x"), "has more than one dimension, expected one, by columns");
    }
    read_entries();
    if constexpr (raw) shorten(a.x, rows * cols, group.child("x"));
  } else if (nz >= nz_csr) {
    a.p = read_indices<decltype(a.p)>(group, "p");
    a.i = read_indices<decltype(a.i)>(group, "i");
    read_entries();
    auto entries = static_cast<std::size_t>(std::max(nz, 0));
    if (nz >= 0) {
      a.storage = Storage::triplet;
      // CSparse has such room in x only: 3.1 writes as many indices as are counted
      if (a.p.size() > 0) require_counted(span_of(a.x), entries, group.child("nz"));
      shorten(a.p, entries, group.child("p"));
    } else {
      a.storage = nz == nz_csc ? Storage::csc : Storage::csr;
      if constexpr (raw) {
        shorten(a.p, (nz == nz_csc ? cols : rows) + 1, group.child("p"));
        entries = std::max(a.i.size(), a.x.size());
      } else {
        if (a.p.empty() || a.p.back() < 0) fail(group.child("p"), "has no valid last pointer");
        entries = static_cast<std::size_t>(a.p.back());
      }
    }
    if constexpr (!raw) {
      if (nz < 0) require_counted(a.x, entries, group.child("p"));
      note_uncounted(a.x, entries, group, left_out);
    }
    // nzmax may leave room at the end
    shorten(a.i, entries, group.child("i"));
    shorten(a.x, entries, group.child("x"));
  } else {
    fail(group.child("nz"), std::to_string(nz) +
                                " is no storage: expected the number of triplets, "
                                "-1 (CSC), -2 (CSR) or -3 (dense)");
  }
  a.info = read_matrix_info(group, otherwise, left_out);
  if constexpr (!raw) {
    if (is_packed(group)) return symmetric_of_triangle(a, group.path);
  }
  return a;
}

/// `otherwise` is the value of a missing text, `groupless` that of all texts if there is no group.
ProblemInfo read_info(const Group& parent, const std::string& otherwise,
                      const std::string& groupless, LeftOut* left_out) {
  ProblemInfo info{groupless, groupless, groupless};
  read_if_possible(left_out, [&] {
    if (!parent.has("info")) return;
    const Handle handle = open_group(parent, "info");
    const Group group{handle.id(), parent.child("info")};
    for_each_field<ProblemInfo>([&](const auto& field) {
      info.*field.member = otherwise;
      read_if_possible(left_out, [&] {
        const std::string name(field.name);
        if (group.has(name)) info.*field.member = read_text(group, name);
      });
    });
  });
  return info;
}

template <class P>
P read_fields(const Group& root, LeftOut* left_out = nullptr) {
  const Handle handle = open_group(root, group_name<P>());
  const Group group{handle.id(), root.child(group_name<P>())};
  P problem;
  for_each_stored_field<P>(group,
                           [&]<class Member>(const Field<P, Member>& field, const Group& place) {
                             const std::string name(field.name);
                             if constexpr (std::is_same_v<Member, Matrix>) {
                               problem.*field.member = read_matrix<Matrix>(place, name, left_out);
                             } else if constexpr (std::is_same_v<Member, Vector>) {
                               problem.*field.member = read_doubles<Vector>(place, name);
                             } else {
                               problem.*field.member = read_number<Member>(place, name);
                             }
                           });
  problem.info = read_info(group, "", "", left_out);
  read_if_possible(left_out, [&] { problem.geometry = read_geometry(root); });
  return problem;
}

template <class P>
RawProblem read_raw_fields(const Group& root) {
  const Handle handle = open_group(root, group_name<P>());
  const Group group{handle.id(), root.child(group_name<P>())};
  RawProblem raw;
  P outline;
  std::size_t contacts = 0;
  for_each_stored_field<P>(group,
                           [&]<class Member>(const Field<P, Member>& field, const Group& place) {
                             const std::string name(field.name);
                             if constexpr (std::is_same_v<Member, Matrix>) {
                               RawMatrix a = read_matrix<RawMatrix>(place, name, nullptr);
                               (outline.*field.member).rows = a.rows;
                               (outline.*field.member).cols = a.cols;
                               raw.members.push_back({field.name, std::move(a)});
                             } else if constexpr (std::is_same_v<Member, Vector>) {
                               auto values = read_doubles<MallocArray<double>>(place, name);
                               if (field.member == &P::mu) contacts = values.size();
                               raw.members.push_back({field.name, std::move(values)});
                             } else {
                               outline.*field.member = read_number<Member>(place, name);
                               raw.members.push_back({field.name, outline.*field.member});
                             }
                           });
  raw.info = read_info(group, absent_text, absent_group, nullptr);

  // the matrices give the lengths of the vectors
  require_contacts(outline, contacts);
  for_each_field<P>([&]<class Member>(const Field<P, Member>& field) {
    if constexpr (std::is_same_v<Member, Vector>) {
      std::size_t size = 0;
      for (const auto& [name, value] : raw.members) {
        if (name == field.name) size = std::get<MallocArray<double>>(value).size();
      }
      detail::require_size(static_cast<Index>(size), outline.size(field.rows), field.rows,
                           "/" + group_name<P>() + "/" + field_path(field), "entries");
    }
  });
  return raw;
}

Solution read_solution_group(const Group& parent, const std::string& name) {
  const Handle handle = open_group(parent, name);
  const Group group{handle.id(), parent.child(name)};
  Solution solution;
  for_each_field<Solution>([&](const auto& field) {
    const std::string member(field.name);
    const bool required = field.presence == Presence::required;
    if (required || (group.has(member) && !is_unwritten(group, member))) {
      solution.*field.member = read_doubles<Vector>(group, member);
    }
  });
  return solution;
}

/// The kind of problem to read: the one that was asked for, or the only one in the file.
std::string kind_to_read(const Group& root, std::string_view asked) {
  const std::string name(asked);
  bool found = false;
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    found = found || (asked == P::kind && root.has(group_name<P>()));
  });
  if (found) return name;
  const std::vector<std::string> kinds = kinds_of(root);
  std::string known;
  for (const auto& other : kinds) known += (known.empty() ? "" : ", ") + other;
  if (!asked.empty()) {
    fail("/", "holds no " + name + " problem" + (known.empty() ? "" : "; it holds: " + known));
  }
  if (kinds.empty()) fail_without_problem(root);
  if (kinds.size() > 1) fail("/", "holds several problems, name one of: " + known);
  return kinds.front();
}

}  // namespace

Contents read_contents(const std::string& path) { return read_from(path, contents_of); }

std::vector<std::string> read_left_out(const std::string& path) {
  return read_from(path, [&](const Group& root) {
    LeftOut left_out;
    for_each_formulation([&]<class P>(std::type_identity<P>) {
      if (root.has(group_name<P>())) read_fields<P>(root, &left_out);
    });
    read_if_possible(&left_out, [&] {
      if (root.has("solution") && !has_solution(root)) {
        left_out.push_back("/solution/r: was declared and never written");
      }
    });
    for (const Numbered& list : {guesses_list, solutions_list}) {
      read_if_possible(&left_out, [&] { static_cast<void>(count_of(root, list)); });
    }
    // several problems share one geometry
    std::vector<std::string> once;
    for (std::string& words : left_out) {
      if (std::find(once.begin(), once.end(), words) == once.end())
        once.push_back(std::move(words));
    }
    return once;
  });
}

Problem read_outline(const std::string& path) { return read_from(path, outline_of); }

Problem read_problem(const std::string& path, std::string_view kind) {
  return read_from(path, [&](const Group& root) {
    const std::string wanted = kind_to_read(root, kind);
    Problem problem;
    for_each_formulation([&]<class P>(std::type_identity<P>) {
      if (wanted != P::kind) return;
      P read = read_fields<P>(root);
      validate(read);
      problem = std::move(read);
    });
    return problem;
  });
}

RawProblem read_raw_problem(const std::string& path, std::string_view kind) {
  return read_from(path, [&](const Group& root) {
    const std::string wanted = kind_to_read(root, kind);
    RawProblem problem;
    for_each_formulation([&]<class P>(std::type_identity<P>) {
      if (wanted == P::kind) problem = read_raw_fields<P>(root);
    });
    return problem;
  });
}

std::optional<Solution> read_solution(const std::string& path, Problem* outline) {
  return read_from(path, [&](const Group& root) -> std::optional<Solution> {
    if (!has_solution(root)) return std::nullopt;
    if (outline != nullptr) *outline = outline_of(root);
    return read_solution_group(root, "solution");
  });
}

namespace {

std::vector<Solution> read_list(const std::string& path, const Numbered& list,
                                Problem* outline = nullptr) {
  return read_from(path, [&](const Group& root) {
    std::vector<Solution> found;
    const Index count = count_of(root, list);
    if (count == 0) return found;
    if (outline != nullptr) *outline = outline_of(root);
    const Handle handle = open_group(root, list.group);
    const Group group{handle.id(), root.child(list.group)};
    for (Index k = 1; k <= count; ++k) {
      found.push_back(read_solution_group(group, std::to_string(k)));
    }
    return found;
  });
}

}  // namespace

std::vector<Solution> read_guesses(const std::string& path, Problem* outline) {
  return read_list(path, guesses_list, outline);
}

std::vector<Solution> read_solutions(const std::string& path) {
  return read_list(path, solutions_list);
}

}  // namespace fclib
