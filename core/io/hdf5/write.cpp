#include "io/hdf5/write.hpp"

#include <list>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <variant>

#include "io/hdf5/contents.hpp"
#include "io/hdf5/geometry_groups.hpp"
#include "io/hdf5/raw.hpp"
#include "io/hdf5/transaction.hpp"

namespace fclib {

using namespace hdf5;

namespace {

/// A text that its file did not have is not written.
void write_text_if_there(const Target& group, const std::string& name, const std::string& text) {
  if (is_there(text)) write_text(group, name, text);
}

RawMatrixView view_of(const Matrix& a) {
  return {.storage = a.storage,
          .rows = a.rows,
          .cols = a.cols,
          .p = a.p,
          .i = a.i,
          .x = a.x,
          .info = a.info};
}

void write_matrix(const Target& parent, const std::string& name, const RawMatrixView& a) {
  const NewGroup created(parent, name);
  const Target& group = created.target();
  write_number(group, "nzmax", static_cast<Index>(a.x.size()));
  write_number(group, "m", a.rows);
  write_number(group, "n", a.cols);
  write_number(group, "nz", a.nz());
  if (a.storage != Storage::dense) {
    write_lasting(group, "p", a.p);
    write_lasting(group, "i", a.i);
  }
  write_lasting(group, "x", a.x);
  if (a.info) {
    write_text_if_there(group, "comment", a.info->comment);
    write_number(group, "conditioning", a.info->conditioning);
    write_number(group, "determinant", a.info->determinant);
    write_number(group, "rank", a.info->rank);
  }
}

/// The problem as it is written. `kept` holds the matrices that were converted for that.
template <class P>
ProblemView view_of(const P& problem, const WriteOptions& options, std::list<Matrix>& kept) {
  const bool as_given = !options.validate;
  ProblemView view{.kind = std::string(P::kind),
                   .members = {},
                   .info = problem.info,
                   .geometry = problem.geometry};
  for_each_field<P>([&]<class Member>(const Field<P, Member>& field) {
    if (field.presence == Presence::mixed && !is_mixed(problem)) return;
    const Member& member = problem.*field.member;
    if constexpr (std::is_same_v<Member, Matrix>) {
      Storage storage = member.storage;
      if (storage == Storage::dense && !options.dense) storage = Storage::csr;
      if (P::triplets_on_disk) storage = Storage::triplet;
      const bool as_it_is = storage == member.storage || as_given;
      const RawMatrixView a =
          view_of(as_it_is ? member : kept.emplace_back(converted(member, storage)));
      if (field.presence != Presence::required && as_given && a.absent()) return;
      view.members.push_back({field.name, a});
    } else if constexpr (std::is_same_v<Member, Vector>) {
      if (field.presence == Presence::optional && member.size() == 0) return;
      const std::span<const double> values(member.data(), static_cast<std::size_t>(member.size()));
      view.members.push_back({field.name, values});
    } else {
      view.members.push_back({field.name, member});
    }
  });
  return view;
}

void write_fields(const Target& root, const ProblemView& problem) {
  const NewGroup created(root, "fclib_" + problem.kind);
  const Target& group = created.target();
  const NewGroup vectors(group, "vectors");
  for (const ProblemView::Member& member : problem.members) {
    const std::string name(member.name);
    std::visit(
        [&]<class Value>(const Value& value) {
          if constexpr (std::is_same_v<Value, RawMatrixView>) {
            write_matrix(group, name, value);
          } else if constexpr (std::is_same_v<Value, Index>) {
            write_number(group, name, value);
          } else {
            write_lasting(vectors.target(), name, value);
          }
        },
        member.value);
  }
  bool informed = false;
  for_each_field<ProblemInfo>([&](const auto& field) {
    informed = informed || problem.info.*field.member != absent_group;
  });
  if (!informed) return;
  const NewGroup info(group, "info");
  for_each_field<ProblemInfo>([&](const auto& field) {
    write_text_if_there(info.target(), std::string(field.name), problem.info.*field.member);
  });
}

void write_solution_group(const Target& parent, const std::string& name, const Solution& solution) {
  const NewGroup group(parent, name);
  for_each_field<Solution>([&](const auto& field) {
    const Vector& values = solution.*field.member;
    if (field.presence != Presence::required && values.size() == 0) return;
    write_lasting(group.target(), std::string(field.name), values);
  });
}

/// Makes room for a new object: one that is there already is removed, or that is an error.
void make_room(const Group& root, const std::string& name, bool replace) {
  if (!root.has(name)) return;
  if (!replace) fail(root.child(name), "is in the file already, and is not to be replaced");
  check(H5Ldelete(root.id, name.c_str(), H5P_DEFAULT), root.child(name));
}

/// `first` and the following numbers of a list.
void write_from(const Target& group, const Numbered& list, std::size_t first,
                const std::vector<Solution>& values) {
  for (std::size_t k = 0; k < values.size(); ++k) {
    write_solution_group(group, std::to_string(first + k), values[k]);
  }
  write_number(group, list.count, static_cast<Index>(first - 1 + values.size()));
}

/// Throws if an added problem takes over a solution or a guess that was written for another one, or
/// if it loses its own to another.
void require_owner(const Group& root, const std::string& kind, bool owned_before, bool brings) {
  const bool others = root.has("solution") || root.has("guesses") || root.has("solutions");
  const bool owner = owner_of(root) == kind;
  if (!owned_before && owner && others) {
    fail("/",
         "the solution and the guesses in the file would become those of the " + kind + " problem");
  }
  if (brings && !owner) {
    fail("/", "a solution or a guess in the file belongs to its " + owner_of(root) +
                  " problem, not to the " + kind + " one");
  }
}

herr_t stop_at_foreign(hid_t, const char* name, const H5A_info_t*, void*) {
  const std::string_view known(name);
  return known == "format" || known == "generator" ? 0 : 1;
}

/// Whether a file has nothing but a problem of this kind and what belongs to it.
bool has_nothing_but(const Group& root, const std::string& kind) {
  hsize_t known = 0;
  for (const std::string& name : {"fclib_" + kind, std::string("solution"), std::string("guesses"),
                                  std::string("solutions")}) {
    known += root.has(name) ? 1U : 0U;
  }
  H5G_info_t info;
  return root.has("fclib_" + kind) && H5Gget_info(root.id, &info) >= 0 && info.nlinks == known &&
         H5Aiterate2(root.id, H5_INDEX_NAME, H5_ITER_INC, nullptr, stop_at_foreign, nullptr) == 0;
}

void write_view(const std::string& path, const ProblemView& problem, const Solution* solution,
                const std::vector<Solution>& guesses, const WriteOptions& options) {
  const Start start = options.append ? Start::existing_or_empty : Start::empty;
  const auto change = [&](const Target& root) {
    const std::string& kind = problem.kind;
    const std::string group = "fclib_" + kind;
    const std::vector<std::string> before = kinds_of(root);
    const bool owned = before.empty() || owner_of(before) == kind;
    if (root.has(group)) {
      make_room(root, group, options.replace);
      // the solution and guesses of another problem stay
      if (owned) make_room(root, "solution", options.replace);
      if (owned) make_room(root, "guesses", options.replace);
      if (owned) make_room(root, "solutions", options.replace);
      if (owned) remove_geometry(root);
    }
    write_fields(root, problem);
    if (problem.geometry) {
      remove_geometry(root);
      write_geometry(root, *problem.geometry);
    }
    if (options.validate) {
      require_owner(root, kind, owned, solution != nullptr || !guesses.empty());
    }
    if (solution != nullptr) {
      make_room(root, "solution", options.replace);
      write_solution_group(root, "solution", *solution);
    }
    if (!guesses.empty()) {
      make_room(root, "guesses", options.replace);
      write_from(NewGroup(root, "guesses").target(), guesses_list, 1, guesses);
    }
  };
  const auto all_goes = [&](const Group& root) {
    return options.replace && has_nothing_but(root, problem.kind);
  };
  change_file(path, start, options.compression, change, all_goes, options.sync);
}

}  // namespace

ProblemView view_of(ProblemPointer problem) {
  std::list<Matrix> none;  // without validation, no matrix is converted
  return std::visit([&](const auto* p) { return view_of(*p, {.validate = false}, none); }, problem);
}

void write_file(const std::string& path, const ProblemView& problem, const WriteOptions& options) {
  write_view(path, problem, nullptr, {}, options);
}

void write_file(const std::string& path, ProblemPointer problem, const Solution* solution,
                const std::vector<Solution>& guesses, const WriteOptions& options) {
  if (options.validate) {
    in_file(path, [&] {
      std::visit(
          [&](const auto* p) {
            validate(*p);
            if (solution != nullptr) validate(*solution, *p);
            for (std::size_t k = 0; k < guesses.size(); ++k) {
              validate(guesses[k], *p, guess_path(k + 1));
            }
          },
          problem);
    });
  }
  std::list<Matrix> kept;
  const ProblemView view =
      std::visit([&](const auto* p) { return view_of(*p, options, kept); }, problem);
  write_view(path, view, solution, guesses, options);
}

void write_solution(const std::string& path, const Solution& solution,
                    const WriteOptions& options) {
  change_file(path, Start::existing, options.compression, [&](const Target& root) {
    if (options.validate) {
      std::visit([&](const auto& p) { validate(solution, p); }, outline_of(root));
    }
    make_room(root, "solution", options.replace);
    write_solution_group(root, "solution", solution);
  });
}

void write_geometry(const std::string& path, const Geometry& geometry,
                    const WriteOptions& options) {
  change_file(path, Start::existing, options.compression, [&](const Target& root) {
    const Index contacts =
        std::visit([](const auto& p) { return p.size(Dim::nc); }, outline_of(root));
    const auto rows = std::get<std::vector<double>>(geometry.contacts.at("gap")).size();
    detail::require_size(static_cast<Index>(rows), contacts, Dim::nc, "/contacts", "rows");
    if (options.replace) remove_geometry(root);
    write_geometry(root, geometry);
  });
}

void write_guesses(const std::string& path, const std::vector<Solution>& guesses,
                   const WriteOptions& options) {
  change_file(path, Start::existing, options.compression, [&](const Target& root) {
    if (options.validate) {
      const Problem outline = outline_of(root);
      for (std::size_t k = 0; k < guesses.size(); ++k) {
        std::visit([&](const auto& p) { validate(guesses[k], p, guess_path(k + 1)); }, outline);
      }
    }
    const Index there = options.append ? count_of(root, guesses_list) : 0;
    if (there > 0) {
      const Handle group = open_group(root, "guesses");
      const Target target{{group.id(), root.child("guesses")}, root.style};
      make_room(target, "number_of_guesses", true);
      write_from(target, guesses_list, static_cast<std::size_t>(there) + 1, guesses);
      return;
    }
    // an empty group is not in the way
    make_room(root, "guesses", options.replace || options.append);
    write_from(NewGroup(root, "guesses").target(), guesses_list, 1, guesses);
  });
}

void write_solutions(const std::string& path, const std::vector<Solution>& solutions,
                     const Vector& errors, const WriteOptions& options) {
  change_file(path, Start::existing, options.compression, [&](const Target& root) {
    if (options.validate) {
      const Problem outline = outline_of(root);
      for (std::size_t k = 0; k < solutions.size(); ++k) {
        const std::string where = "/solutions/" + std::to_string(k + 1);
        std::visit([&](const auto& p) { validate(solutions[k], p, where); }, outline);
      }
    }
    make_room(root, "solutions", options.replace);
    if (solutions.empty()) return;
    const NewGroup group(root, "solutions");
    write_from(group.target(), solutions_list, 1, solutions);
    write_numbers(group.target(), "error", errors);
  });
}

}  // namespace fclib
