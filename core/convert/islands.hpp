// Islands: groups of contacts, degrees of freedom and bilateral constraints that no non-zero of a
// matrix links. Each is a problem of its own. Together, their solutions are that of the whole.
#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "convert/arrange.hpp"
#include "linalg/groups.hpp"
#include "problem.hpp"

namespace fclib {

/// The number of the island of each contact (nc), degree of freedom (n) and bilateral constraint
/// (p). Islands are numbered by their first contact. Everything that touches no contact is one more
/// island, the last.
struct Islands {
  Index count = 0;
  Index spacedim = 3;
  std::vector<Index> contact = {};
  std::vector<Index> dof = {};
  std::vector<Index> bilateral = {};

  /// The island of an entry of a field.
  [[nodiscard]] Index of(Dim dim, Index entry) const {
    switch (dim) {
      case Dim::n:
        return dof[entry];
      case Dim::m:
        return contact[entry / spacedim];
      case Dim::p:
        return bilateral[entry];
      default:
        return contact[entry];
    }
  }
  [[nodiscard]] Index size(Dim dim) const {
    switch (dim) {
      case Dim::n:
        return static_cast<Index>(dof.size());
      case Dim::m:
        return spacedim * static_cast<Index>(contact.size());
      case Dim::p:
        return static_cast<Index>(bilateral.size());
      default:
        return static_cast<Index>(contact.size());
    }
  }
};

/// The islands of a problem, which must be valid. A stored zero links nothing.
template <class P>
Islands islands(const P& problem) {
  const Index nc = problem.size(Dim::nc);
  const Index n = problem.size(Dim::n);
  const Index p = problem.size(Dim::p);
  const Index d = problem.spacedim;
  const auto node = [&](Dim dim, Index entry) -> Index {
    if (dim == Dim::m) return entry / d;
    return dim == Dim::n ? nc + entry : nc + n + entry;
  };
  Groups groups(nc + n + p);
  for_each_field<P>([&]<class Member>(const Field<P, Member>& field) {
    if constexpr (std::same_as<Member, Matrix>) {
      for_each_entry(problem.*field.member, [&](Index row, Index col, double value) {
        if (value != 0) groups.link(node(field.rows, row), node(field.cols, col));
      });
    }
  });
  Islands result{.spacedim = d};
  std::vector<Index> number(static_cast<std::size_t>(nc + n + p), -1);
  for (Index contact = 0; contact < nc; ++contact) {
    Index& own = number[groups.find(contact)];
    if (own < 0) own = result.count++;
    result.contact.push_back(own);
  }
  bool rest = false;
  const auto number_of = [&](Index node) {
    const Index own = number[groups.find(node)];
    rest = rest || own < 0;
    return own < 0 ? result.count : own;
  };
  for (Index k = 0; k < n; ++k) result.dof.push_back(number_of(nc + k));
  for (Index k = 0; k < p; ++k) result.bilateral.push_back(number_of(nc + n + k));
  result.count += rest ? 1 : 0;
  return result;
}

/// Where the entries of each island stand in the whole.
std::vector<Arrangement> places_of(const Islands& islands);

namespace detail {

/// Whether a value has the sizes of the islands.
template <class Struct>
void require_fit(const Struct& value, const Islands& islands) {
  for_each_field<Struct>([&]<class Member>(const Field<Struct, Member>& field) {
    if constexpr (std::same_as<Member, Vector>) {
      const Vector& x = value.*field.member;
      if (field.presence != Presence::required && x.size() == 0) return;
      require_size(static_cast<Index>(x.size()), islands.size(field.rows), field.rows,
                   std::string(field.name), "entries");
    } else if constexpr (std::same_as<Member, Matrix>) {
      const Matrix& a = value.*field.member;
      if (a.empty()) return;
      require_size(a.rows, islands.size(field.rows), field.rows, std::string(field.name), "rows");
      require_size(a.cols, islands.size(field.cols), field.cols, std::string(field.name),
                   "columns");
    }
  });
}

}  // namespace detail

/// The islands of a problem (or of a solution of it), each with its own numbers. Throws Error
/// (problem) if the sizes are not those of the islands, or if an entry links two of them.
template <class Struct>
std::vector<Struct> split(const Struct& whole, const Islands& islands) {
  detail::require_fit(whole, islands);
  const std::vector<Arrangement> places = places_of(islands);
  // from the whole's numbers to those inside an island
  const auto inner = [&](Dim dim) {
    std::vector<Index> own(static_cast<std::size_t>(islands.size(dim)));
    for (const Arrangement& island : places) {
      const std::vector<Index>& to = island.places(dim).to;
      for (std::size_t k = 0; k < to.size(); ++k) own[to[k]] = static_cast<Index>(k);
    }
    return own;
  };
  std::vector<Struct> parts(places.size());
  if constexpr (requires { whole.spacedim; }) {
    for (Struct& part : parts) {
      part.spacedim = whole.spacedim;
      part.info = whole.info;
    }
  }
  for_each_field<Struct>([&]<class Member>(const Field<Struct, Member>& field) {
    const Member& member = whole.*field.member;
    if constexpr (std::same_as<Member, Vector>) {
      if (field.presence != Presence::required && member.size() == 0) return;
      for (std::size_t k = 0; k < parts.size(); ++k) {
        parts[k].*field.member = gathered(member, places[k].places(field.rows));
      }
    } else if constexpr (std::same_as<Member, Matrix>) {
      if (member.empty()) return;
      for (std::size_t k = 0; k < parts.size(); ++k) {
        Matrix& part = parts[k].*field.member;
        part.storage = Storage::triplet;
        part.rows = static_cast<Index>(places[k].places(field.rows).to.size());
        part.cols = static_cast<Index>(places[k].places(field.cols).to.size());
      }
      const std::vector<Index> rows = inner(field.rows);
      const std::vector<Index> cols = inner(field.cols);
      for_each_entry(member, [&](Index row, Index col, double value) {
        const Index island = islands.of(field.rows, row);
        if (islands.of(field.cols, col) != island) {
          if (value == 0) return;
          throw Error(
              ErrorKind::problem,
              "entry (" + std::to_string(row) + ", " + std::to_string(col) + ") links two islands",
              std::string(field.name));
        }
        Matrix& part = parts[island].*field.member;
        part.i.push_back(rows[row]);
        part.p.push_back(cols[col]);
        part.x.push_back(value);
      });
      for (std::size_t k = 0; k < parts.size(); ++k) {
        Matrix& a = parts[k].*field.member;
        const bool plain = field.presence == Presence::mixed && places[k].p.to.empty();
        a = plain ? Matrix{} : converted(a, member.storage);
      }
    }
  });
  return parts;
}

/// The whole of which these are the islands: it undoes split. Matrices get the storage of the first
/// part's, and what is known of them is dropped. Throws Error (problem) if the sizes disagree.
template <class Struct>
Struct merge(const std::vector<Struct>& parts, const Islands& islands) {
  const std::vector<Arrangement> places = places_of(islands);
  if (parts.size() != places.size()) {
    throw Error(ErrorKind::problem, std::to_string(parts.size()) + " parts for " +
                                        std::to_string(places.size()) + " islands");
  }
  Struct whole;
  if constexpr (requires { whole.spacedim; }) {
    whole.spacedim = islands.spacedim;
    if (!parts.empty()) whole.info = parts.front().info;
  }
  for_each_field<Struct>([&]<class Member>(const Field<Struct, Member>& field) {
    const auto fits = [&](std::size_t k, Index size, Dim dim, const char* what) {
      detail::require_size(size, static_cast<Index>(places[k].places(dim).to.size()), dim,
                           "part " + std::to_string(k) + ": " + std::string(field.name), what);
    };
    Member& member = whole.*field.member;
    if constexpr (std::same_as<Member, Vector>) {
      bool present = field.presence == Presence::required || islands.size(field.rows) == 0;
      for (const Struct& part : parts) present = present || (part.*field.member).size() > 0;
      if (!present) return;
      member = Vector::Zero(islands.size(field.rows));
      for (std::size_t k = 0; k < parts.size(); ++k) {
        const Vector& part = parts[k].*field.member;
        fits(k, static_cast<Index>(part.size()), field.rows, "entries");
        for (Eigen::Index j = 0; j < part.size(); ++j) {
          member[places[k].places(field.rows).to[j]] = part[j];
        }
      }
    } else if constexpr (std::same_as<Member, Matrix>) {
      std::optional<Storage> storage;
      Matrix sum{.storage = Storage::triplet,
                 .rows = islands.size(field.rows),
                 .cols = islands.size(field.cols)};
      if (field.presence == Presence::mixed && islands.bilateral.empty()) return;
      for (std::size_t k = 0; k < parts.size(); ++k) {
        const Matrix& part = parts[k].*field.member;
        if (part.empty()) continue;
        if (!storage) storage = part.storage;
        fits(k, part.rows, field.rows, "rows");
        fits(k, part.cols, field.cols, "columns");
        for_each_entry(part, [&](Index row, Index col, double value) {
          sum.i.push_back(places[k].places(field.rows).to[row]);
          sum.p.push_back(places[k].places(field.cols).to[col]);
          sum.x.push_back(value);
        });
      }
      member = converted(sum, storage.value_or(Storage::csr));
    }
  });
  return whole;
}

/// Independent problems as the islands of one, one after the other. Throws Error (problem) if they
/// have different spacedims, or if there is none.
template <class P>
Islands beside(const std::vector<P>& problems) {
  if (problems.empty()) throw Error(ErrorKind::problem, "there is no problem to merge");
  Islands islands{.count = static_cast<Index>(problems.size()),
                  .spacedim = problems.front().spacedim};
  for (Index k = 0; k < islands.count; ++k) {
    const P& problem = problems[static_cast<std::size_t>(k)];
    if (problem.spacedim != islands.spacedim) {
      throw Error(ErrorKind::problem,
                  "is " + std::to_string(problem.spacedim) + ", that of the first is " +
                      std::to_string(islands.spacedim),
                  "part " + std::to_string(k) + ": spacedim");
    }
    islands.contact.insert(islands.contact.end(), problem.size(Dim::nc), k);
    islands.dof.insert(islands.dof.end(), problem.size(Dim::n), k);
    islands.bilateral.insert(islands.bilateral.end(), problem.size(Dim::p), k);
  }
  return islands;
}

}  // namespace fclib
