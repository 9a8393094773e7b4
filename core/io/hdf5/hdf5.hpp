// FCLIB files: HDF5 in the layout of libfclib 3.1, for every formulation in problems/.
//
//   /fclib_local/{spacedim, W/, V/, R/, vectors/{q,mu,s}, info/{title,description,math_info}}
//   /fclib_global/{spacedim, M/, H/, G/, vectors/{f,w,mu,b}, info/}
//   /fclib_local_rolling, /fclib_global_rolling: the same, and vectors/mu_r
//   /fclib_local_spin, /fclib_global_spin: the same, vectors/mu_s, coupled, and vectors/mu_r if
//   spacedim is 6
//   /solution/{v,u,r,l}
//   /guesses/{number_of_guesses, 1/{v,u,r,l}, 2/, ...}
//   /solutions/{number_of_solutions, error, 1/{v,u,r,l}, 2/, ...}: all known solutions
//   /fclib_sequence: many problems in one file that grows (stored_sequence.hpp)
//   matrix group: nzmax, m, n, nz, p, i, x; nz >= 0 triplet, -1 CSC, -2 CSR, -3 dense
//
// Every function throws Error (file) that names the file and the dataset. Writes are atomic: the
// new file is made beside the old one and renamed over it. Writers that add to one file take turns.
// HDF5 is not thread-safe; a lock of the library makes these functions so.
#pragma once

#include "io/hdf5/attributes.hpp"
#include "io/hdf5/library.hpp"
#include "io/hdf5/raw.hpp"
#include "io/hdf5/read.hpp"
#include "io/hdf5/sequence.hpp"
#include "io/hdf5/write.hpp"
