// Inverses and determinants of the blocks of contacts, compiled once: those of 5 x 5 are an LU
// factorisation, which costs the compiler seconds wherever it is written.
#pragma once

#include "contact/cone.hpp"

namespace fclib {

/// For D = 2, 3, 5.
template <int D>
ContactMatrix<D> inverse(const ContactMatrix<D>& a);
template <int D>
double determinant(const ContactMatrix<D>& a);

}  // namespace fclib
