// The storage of a problem's matrices: the same numbers in another arrangement.
#pragma once

#include <limits>
#include <string>
#include <string_view>

#include "problem.hpp"

namespace fclib {

constexpr std::string_view name_of(Storage storage) {
  switch (storage) {
    case Storage::triplet:
      return "triplet";
    case Storage::csc:
      return "csc";
    case Storage::csr:
      return "csr";
    case Storage::dense:
      return "dense";
  }
  return "?";
}

/// The storage of a name. Throws Error (option) if there is none.
inline Storage storage_of(std::string_view name) {
  std::string known;
  for (const auto storage : {Storage::csr, Storage::csc, Storage::triplet, Storage::dense}) {
    if (name == name_of(storage)) return storage;
    known += (known.empty() ? "" : ", ") + std::string(name_of(storage));
  }
  throw Error(ErrorKind::option,
              "there is no storage '" + std::string(name) + "'; there are: " + known, "storage");
}

/// The problem with all its matrices in one storage. Any change of storage adds duplicates up. The
/// problem must be valid. Throws Error (unsuitable) if a dense matrix would have more entries than
/// an index can count.
template <class P>
P with_storage(P problem, Storage storage) {
  for_each_field<P>([&]<class Member>(const Field<P, Member>& field) {
    if constexpr (std::same_as<Member, Matrix>) {
      Matrix& a = problem.*field.member;
      if (a.empty()) return;
      const auto entries = static_cast<double>(a.rows) * static_cast<double>(a.cols);
      if (storage == Storage::dense && entries > std::numeric_limits<Index>::max()) {
        throw Error(ErrorKind::unsuitable,
                    "is " + std::to_string(a.rows) + " x " + std::to_string(a.cols) +
                        ", too large to be dense",
                    std::string(field.name));
      }
      a = converted(a, storage);
    }
  });
  return problem;
}

}  // namespace fclib
