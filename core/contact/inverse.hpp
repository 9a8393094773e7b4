// Inverses and determinants of the blocks of contacts, compiled once: for 5 x 5 they are an LU
// factorisation, and each place that contains it costs the compiler seconds.
#pragma once

#include "contact/cone.hpp"

namespace fclib {

/// For each D of FCLIB_FOR_EACH_DIMENSION.
template <int D>
ContactMatrix<D> inverse(const ContactMatrix<D>& a);
template <int D>
double determinant(const ContactMatrix<D>& a);

}  // namespace fclib
