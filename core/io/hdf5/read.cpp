#include "io/hdf5/read.hpp"

#include <algorithm>
#include <optional>
#include <utility>
#include <variant>

#include "io/hdf5/contents.hpp"
#include "io/hdf5/geometry_groups.hpp"
#include "io/hdf5/raw.hpp"

namespace fclib {

using namespace hdf5;

namespace {

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

std::string read_text_if_there(const Group& group, const std::string& name,
                               const std::string& otherwise) {
  return group.has(name) ? read_text(group, name) : otherwise;
}

std::optional<MatrixInfo> read_matrix_info(const Group& group, const std::string& otherwise) {
  if (!group.has("comment") && !group.has("conditioning") && !group.has("determinant") &&
      !group.has("rank")) {
    return {};
  }
  MatrixInfo info;
  info.comment = read_text_if_there(group, "comment", otherwise);
  if (group.has("conditioning")) info.conditioning = read_number<double>(group, "conditioning");
  if (group.has("determinant")) info.determinant = read_number<double>(group, "determinant");
  if (group.has("rank")) info.rank = read_number<Index>(group, "rank");
  return info;
}

template <class A>
A read_matrix(const Group& parent, const std::string& name) {
  constexpr bool raw = std::is_same_v<A, RawMatrix>;
  const Handle handle = open_group(parent, name);
  const Group group{handle.id(), parent.child(name)};
  A a = read_matrix_sizes<A>(group);
  const auto rows = static_cast<std::size_t>(a.rows);
  const auto cols = static_cast<std::size_t>(a.cols);
  const Index nz = read_number<Index>(group, "nz");
  const auto read_entries = [&] { a.x = read_doubles<decltype(a.x)>(group, "x"); };
  if (nz == nz_dense) {
    a.storage = Storage::dense;
    read_entries();
    if constexpr (raw) shorten(a.x, rows * cols, group.child("x"));
  } else if (nz >= nz_csr) {
    a.p = read_indices<decltype(a.p)>(group, "p");
    a.i = read_indices<decltype(a.i)>(group, "i");
    read_entries();
    auto entries = static_cast<std::size_t>(std::max(nz, 0));
    if (nz >= 0) {
      a.storage = Storage::triplet;
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
    // nzmax may leave room at the end
    shorten(a.i, entries, group.child("i"));
    shorten(a.x, entries, group.child("x"));
  } else {
    fail(group.child("nz"), std::to_string(nz) +
                                " is no storage: expected the number of triplets, "
                                "-1 (CSC), -2 (CSR) or -3 (dense)");
  }
  a.info = read_matrix_info(group, raw ? absent_text : std::string());
  return a;
}

/// `otherwise` is the value of a text that is not there, `groupless` that of all without the group.
ProblemInfo read_info(const Group& parent, const std::string& otherwise,
                      const std::string& groupless) {
  ProblemInfo info;
  std::optional<Handle> handle;
  if (parent.has("info")) handle.emplace(open_group(parent, "info"));
  for_each_field<ProblemInfo>([&](const auto& field) {
    info.*field.member = handle ? read_text_if_there({handle->id(), parent.child("info")},
                                                     std::string(field.name), otherwise)
                                : groupless;
  });
  return info;
}

template <class P>
P read_fields(const Group& root) {
  const Handle handle = open_group(root, group_name<P>());
  const Group group{handle.id(), root.child(group_name<P>())};
  P problem;
  for_each_stored_field<P>(group,
                           [&]<class Member>(const Field<P, Member>& field, const Group& place) {
                             const std::string name(field.name);
                             if constexpr (std::is_same_v<Member, Matrix>) {
                               problem.*field.member = read_matrix<Matrix>(place, name);
                             } else if constexpr (std::is_same_v<Member, Vector>) {
                               problem.*field.member = read_doubles<Vector>(place, name);
                             } else {
                               problem.*field.member = read_number<Member>(place, name);
                             }
                           });
  problem.info = read_info(group, "", "");
  problem.geometry = read_geometry(root);
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
                               RawMatrix a = read_matrix<RawMatrix>(place, name);
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
  raw.info = read_info(group, absent_text, absent_group);

  // vectors have the lengths that the matrices give them
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
    if (field.presence == Presence::required || group.has(member)) {
      solution.*field.member = read_doubles<Vector>(group, member);
    }
  });
  return solution;
}

/// The kind of problem to read: the one asked for, or the only one there is.
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
  if (kinds.empty()) fail("/", "holds no problem in a known FCLIB layout");
  if (kinds.size() > 1) fail("/", "holds several problems, name one of: " + known);
  return kinds.front();
}

}  // namespace

Contents read_contents(const std::string& path) { return read_from(path, contents_of); }

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
    if (!root.has("solution")) return std::nullopt;
    if (outline != nullptr) *outline = outline_of(root);
    return read_solution_group(root, "solution");
  });
}

namespace {

std::vector<Solution> read_list(const std::string& path, const Numbered& list,
                                Index Contents::* how_many, Problem* outline = nullptr) {
  return read_from(path, [&](const Group& root) {
    std::vector<Solution> found;
    const Index count = contents_of(root).*how_many;
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
  return read_list(path, guesses_list, &Contents::guesses, outline);
}

std::vector<Solution> read_solutions(const std::string& path) {
  return read_list(path, solutions_list, &Contents::solutions);
}

}  // namespace fclib
