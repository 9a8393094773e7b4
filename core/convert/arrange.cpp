#include "convert/arrange.hpp"

namespace fclib {

Matrix arranged(const Matrix& a, const Places& rows, const Places& cols) {
  Matrix result{.storage = Storage::triplet,
                .rows = rows.count,
                .cols = cols.count,
                .p = {},
                .i = {},
                .x = {},
                .info = {}};
  result.i.reserve(a.nnz());
  result.p.reserve(a.nnz());
  result.x.reserve(a.nnz());
  for_each_entry(a, [&](Index row, Index col, double value) {
    result.i.push_back(rows.to[row]);
    result.p.push_back(cols.to[col]);
    result.x.push_back(value);
  });
  return converted(result, a.storage);
}

Vector arranged(const Vector& x, const Places& places) {
  Vector result = Vector::Zero(places.count);
  for (Eigen::Index k = 0; k < x.size(); ++k) result[places.to[k]] = x[k];
  return result;
}

Vector gathered(const Vector& x, const Places& places) {
  Vector result(static_cast<Eigen::Index>(places.to.size()));
  for (Eigen::Index k = 0; k < result.size(); ++k) result[k] = x[places.to[k]];
  return result;
}

}  // namespace fclib
