#include "contact/inverse.hpp"

#include <Eigen/LU>

#include "contact/cones.hpp"

namespace fclib {

template <int D>
ContactMatrix<D> inverse(const ContactMatrix<D>& a) {
  return a.inverse();
}

template <int D>
double determinant(const ContactMatrix<D>& a) {
  return a.determinant();
}

#define FCLIB_INSTANTIATE(D)                                     \
  template ContactMatrix<D> inverse<D>(const ContactMatrix<D>&); \
  template double determinant<D>(const ContactMatrix<D>&);
FCLIB_FOR_EACH_DIMENSION(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
