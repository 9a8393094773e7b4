#include "contact/inverse.hpp"

#include <Eigen/LU>

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
FCLIB_INSTANTIATE(2)
FCLIB_INSTANTIATE(3)
FCLIB_INSTANTIATE(5)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
