#include "capi/to_c.hpp"

#include <cstring>
#include <limits>
#include <utility>

#include "capi/errors.hpp"

namespace fclib::c {

namespace {

double* copy_vector(const Vector& values) { return malloc_copy(values).release(); }

char* copy_text(const std::string& value) {
  if (value == absent_text || value == absent_group) return nullptr;
  auto* result = allocate<char>(value.size() + 1);
  std::memcpy(result, value.c_str(), value.size());
  return result;
}

/// A dense matrix becomes one by columns, without its zeros.
void put_by_columns(RawMatrix& a) {
  const auto rows = static_cast<std::size_t>(a.rows);
  const auto cols = static_cast<std::size_t>(a.cols);
  std::size_t entries = 0;
  for (std::size_t k = 0; k < rows * cols; ++k) entries += a.x[k] != 0 ? 1U : 0U;
  if (entries > static_cast<std::size_t>(std::numeric_limits<int>::max())) {
    fail("a dense matrix",
         "has more entries than an int counts: read it as it is, by "
         "fclib_keep_dense(1)");
  }
  a.storage = Storage::csc;
  a.p = MallocArray<Index>(cols + 1);
  a.i = MallocArray<Index>(entries);
  MallocArray<double> x(entries);
  std::size_t at = 0;
  for (std::size_t col = 0; col < cols; ++col) {
    a.p[col] = static_cast<Index>(at);
    for (std::size_t row = 0; row < rows; ++row) {
      const double value = a.x[row + col * rows];
      if (value == 0) continue;
      a.i[at] = static_cast<Index>(row);
      x[at++] = value;
    }
  }
  a.p[cols] = static_cast<Index>(at);
  a.x = std::move(x);
}

fclib_matrix* to_c(RawMatrix& a) {
  Owned<fclib_matrix> c(allocate<fclib_matrix>(1));
  c->nzmax = static_cast<int>(a.x.size());
  c->m = a.rows;
  c->n = a.cols;
  switch (a.storage) {
    case Storage::triplet:
      c->nz = static_cast<int>(a.x.size());
      break;
    case Storage::csc:
      c->nz = nz_csc;
      break;
    case Storage::csr:
      c->nz = nz_csr;
      break;
    case Storage::dense:
      c->nz = nz_dense;
      break;
  }
  if (a.storage != Storage::dense) {
    c->p = a.p.release();
    c->i = a.i.release();
  }
  c->x = a.x.release();
  if (a.info) {
    c->info = allocate<fclib_matrix_info>(1);
    c->info->comment = copy_text(a.info->comment);
    c->info->conditioning = a.info->conditioning;
    c->info->determinant = a.info->determinant;
    c->info->rank = a.info->rank;
  }
  return c.release();
}

}  // namespace

void free_members(fclib_matrix& a) {
  std::free(a.p);
  std::free(a.i);
  std::free(a.x);
  if (a.info != nullptr) std::free(a.info->comment);
  std::free(a.info);
}

template <class C>
C* to_c(RawProblem& problem, bool keep_dense) {
  Owned<C> c(allocate<C>(1));
  for (RawProblem::Member& given : problem.members) {
    // a lambda takes no structured binding in, for clang before 16
    auto& name = given.name;
    auto& value = given.value;
    for_each_member<C>([&]<class Field, class Pointer>(const Field& field, Pointer member) {
      if (field.name != name) return;
      using CType = std::remove_reference_t<decltype((*c).*member)>;
      if constexpr (std::is_same_v<CType, int>) {
        (*c).*member = std::get<Index>(value);
      } else if constexpr (std::is_same_v<CType, fclib_matrix*>) {
        auto& matrix = std::get<RawMatrix>(value);
        if (matrix.storage == Storage::dense && !keep_dense) put_by_columns(matrix);
        (*c).*member = to_c(matrix);
      } else {
        (*c).*member = std::get<MallocArray<double>>(value).release();
      }
    });
  }
  Owned<fclib_info> info(allocate<fclib_info>(1));
  bool informed = false;
  for_each_member<fclib_info>([&](const auto& field, char* fclib_info::* member) {
    (*info).*member = copy_text(problem.info.*field.member);
    informed = informed || problem.info.*field.member != absent_group;
  });
  if (informed) c->info = info.release();
  return c.release();
}

template <class C>
C* to_c(const CoreOf<C>& problem) {
  using P = CoreOf<C>;
  RawProblem raw;
  for_each_field<P>([&]<class Type>(const Field<P, Type>& field) {
    const Type& value = problem.*field.member;
    const bool optional = field.presence != Presence::required;
    if constexpr (std::is_same_v<Type, Index>) {
      raw.members.push_back({field.name, value});
    } else if constexpr (std::is_same_v<Type, Matrix>) {
      if (!optional || !value.empty()) raw.members.push_back({field.name, raw_copy(value)});
    } else if constexpr (std::is_same_v<Type, Vector>) {
      if (!optional || value.size() > 0) raw.members.push_back({field.name, malloc_copy(value)});
    }
  });
  raw.info = problem.info;
  if (raw.info.title.empty() && raw.info.description.empty() && raw.info.math_info.empty()) {
    raw.info = {absent_group, absent_group, absent_group};
  }
  return to_c<C>(raw, false);
}

void to_c(const Solution& solution, const Problem& outline, const std::string& where,
          fclib_solution& c) {
  for_each_member<fclib_solution>([&](const auto& field, double* fclib_solution::* member) {
    const Index size = std::visit([&](const auto& p) { return p.size(field.rows); }, outline);
    const Vector& values = solution.*field.member;
    if (values.size() != size) {
      fail(where + "/" + std::string(field.name),
           "has " + std::to_string(values.size()) + " entries, expected " + std::to_string(size));
    }
    const bool absent = field.presence != Presence::required && size == 0;
    if (!absent) c.*member = copy_vector(values);
  });
}

#define FCLIB_TO_C(kind)                          \
  template fclib_##kind* to_c(RawProblem&, bool); \
  template fclib_##kind* to_c<fclib_##kind>(const CoreOf<fclib_##kind>&);

FCLIB_FOR_EACH_KIND(FCLIB_TO_C)

#undef FCLIB_TO_C

}  // namespace fclib::c
