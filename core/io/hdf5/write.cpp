#include "io/hdf5/write.hpp"

#include <optional>
#include <utility>
#include <variant>

#include "io/hdf5/contents.hpp"
#include "io/hdf5/geometry_groups.hpp"
#include "io/hdf5/raw.hpp"
#include "io/hdf5/transaction.hpp"

namespace fclib {

using namespace hdf5;

namespace {

/// A text that its file did not have stays away.
void write_text_if_there(const Target& group, const std::string& name, const std::string& text) {
  if (text != absent_text && text != absent_group) write_text(group, name, text);
}

void write_matrix(const Target& parent, const std::string& name, const Matrix& a) {
  const NewGroup created(parent, name);
  const Target& group = created.target();
  const auto nnz = static_cast<Index>(a.nnz());
  const auto nz = [&]() -> Index {
    switch (a.storage) {
      case Storage::triplet:
        return nnz;
      case Storage::csc:
        return nz_csc;
      case Storage::csr:
        return nz_csr;
      case Storage::dense:
        return nz_dense;
    }
    return nnz;
  }();
  write_number(group, "nzmax", nnz);
  write_number(group, "m", a.rows);
  write_number(group, "n", a.cols);
  write_number(group, "nz", nz);
  if (a.storage != Storage::dense) {
    write_numbers(group, "p", a.p);
    write_numbers(group, "i", a.i);
  }
  write_numbers(group, "x", a.x);
  if (a.info) {
    write_text_if_there(group, "comment", a.info->comment);
    write_number(group, "conditioning", a.info->conditioning);
    write_number(group, "determinant", a.info->determinant);
    write_number(group, "rank", a.info->rank);
  }
}

template <class P>
void write_fields(const Target& root, const P& problem, const WriteOptions& options) {
  const bool as_given = !options.validate;
  const NewGroup created(root, group_name<P>());
  const Target& group = created.target();
  const NewGroup vectors(group, "vectors");
  for_each_field<P>([&]<class Member>(const Field<P, Member>& field) {
    const std::string name(field.name);
    if (field.presence == Presence::mixed && !is_mixed(problem)) return;
    if constexpr (std::is_same_v<Member, Matrix>) {
      const Matrix& a = problem.*field.member;
      // read from a file without it
      if (field.presence != Presence::required && as_given && a.empty() && a.p.empty()) return;
      Storage storage = a.storage;
      if (storage == Storage::dense && !options.dense) storage = Storage::csr;
      if (P::triplets_on_disk) storage = Storage::triplet;
      if (storage == a.storage || as_given) {
        write_matrix(group, name, a);
      } else {
        write_matrix(group, name, converted(a, storage));
      }
    } else if constexpr (std::is_same_v<Member, Vector>) {
      write_numbers(vectors.target(), name, problem.*field.member);
    } else {
      write_number(group, name, problem.*field.member);
    }
  });
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
    write_numbers(group.target(), std::string(field.name), values);
  });
}

/// Makes room for what is to be written: where something is there already, it goes, or that is an
/// error.
void make_room(const Group& root, const std::string& name, bool replace) {
  if (!root.has(name)) return;
  if (!replace) fail(root.child(name), "is in the file already, and is not to be replaced");
  check(H5Ldelete(root.id, name.c_str(), H5P_DEFAULT), root.child(name));
}

/// Numbers `first` and the following ones of a list.
void write_from(const Target& group, const Numbered& list, std::size_t first,
                const std::vector<Solution>& values) {
  for (std::size_t k = 0; k < values.size(); ++k) {
    write_solution_group(group, std::to_string(first + k), values[k]);
  }
  write_number(group, list.count, static_cast<Index>(first - 1 + values.size()));
}

/// Throws where a problem that was added is the one that a solution or a guess now belongs to,
/// though it was written for another; or where it is not, though they are its own.
void require_owner(const Group& root, const std::string& kind, bool owned_before, bool brings) {
  const bool others = root.has("solution") || root.has("guesses") || root.has("solutions");
  const bool owner = owner_of(kinds_of(root)) == kind;
  if (!owned_before && owner && others) {
    fail("/",
         "the solution and the guesses in the file would become those of the " + kind + " problem");
  }
  if (brings && !owner) {
    fail("/", "a solution or a guess in the file belongs to its " + owner_of(kinds_of(root)) +
                  " problem, not to the " + kind + " one");
  }
}

}  // namespace

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
  const Start start = options.append ? Start::existing_or_empty : Start::empty;
  change_file(path, start, options.compression, [&](const Target& root) {
    const std::string kind =
        std::visit([]<class P>(const P*) { return std::string(P::kind); }, problem);
    const std::string group = "fclib_" + kind;
    const std::vector<std::string> before = kinds_of(root);
    const bool owned = before.empty() || owner_of(before) == kind;
    if (root.has(group)) {
      make_room(root, group, options.replace);
      // those of another problem stay
      if (owned) make_room(root, "solution", options.replace);
      if (owned) make_room(root, "guesses", options.replace);
      if (owned) make_room(root, "solutions", options.replace);
      if (owned) remove_geometry(root);
    }
    std::visit(
        [&](const auto* p) {
          write_fields(root, *p, options);
          if (!p->geometry) return;
          remove_geometry(root);
          write_geometry(root, *p->geometry);
        },
        problem);
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
  });
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

void write_guesses(const std::string& path, const std::vector<Solution>& guesses,
                   const WriteOptions& options) {
  change_file(path, Start::existing, options.compression, [&](const Target& root) {
    if (options.validate) {
      const Problem outline = outline_of(root);
      for (std::size_t k = 0; k < guesses.size(); ++k) {
        std::visit([&](const auto& p) { validate(guesses[k], p, guess_path(k + 1)); }, outline);
      }
    }
    const Index there = options.append ? contents_of(root).guesses : 0;
    if (there > 0) {
      const Handle group = open_group(root, "guesses");
      const Target target{{group.id(), root.child("guesses")}, root.style};
      make_room(target, "number_of_guesses", true);
      write_from(target, guesses_list, static_cast<std::size_t>(there) + 1, guesses);
      return;
    }
    // an empty group is no reason to refuse
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
