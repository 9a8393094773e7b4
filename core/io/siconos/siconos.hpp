// Siconos' text format (".dat"): what its *_printInFile functions write and its *_new_from_filename
// functions read, for every formulation in problems/ without bilateral constraints.
//
//   d  nc  A...  vectors...           numbers between white space, in the order of fields():
//                                     local W q mu, global M H f w mu, rolling ones mu_r at the end
//   A: storage rows cols, then
//     0 dense     rows cols, x by columns
//     1 blocks    count nb0 nb1, the nb0 and nb1 cumulated block sizes, filled1 filled2, the
//     filled1
//                 pointers and filled2 block columns, then each block: its number, x by columns
//     2 sparse    origin (1 triplet, 2 by columns, 3 by rows), then what CSparse prints:
//                 a line with its version, "[triplet: ]R-by-C, nzmax: N nnz: N[, 1-norm: X]", and
//                 "row col : x" lines, or for each column "col J : locations A to B" and its
//                 "row : x" lines
//
// The format does not say which formulation it holds: the sizes do. Old files end with one more
// integer, 0 or 1 (whether A is symmetric), which is passed over. Siconos prints sparse entries
// with six digits; here every number is written with as many as it takes to read it back equal.
#pragma once

#include <string>
#include <string_view>

#include "problem.hpp"

namespace fclib {

/// The problem in a text file, validated; its title is the name of the file. Dense and sparse
/// matrices keep their storage, blocks are read by rows (CSR). `kind` ("local", "global_rolling")
/// says what the file holds where its sizes should not decide.
/// Throws Error (file) that names the file and the line, or Error (problem) as validate() does.
Problem read_siconos(const std::string& path, std::string_view kind = {});

/// The same of a text in memory, without a title and a file's name in messages.
Problem parse_siconos(std::string_view text, std::string_view kind = {});

/// Writes a text file, or replaces the old one whole, atomically. Each matrix keeps its storage;
/// one by rows, which Siconos has no sparse text for, is written in blocks of d x d where its sides
/// are those of the contacts (W), by columns elsewhere. Duplicates are added up, and blocks on the
/// diagonal are written even where they are zero: Siconos looks for them.
/// Throws Error (unsuitable) where the problem has bilateral constraints, Error (problem) where it
/// is not valid, Error (file).
void write_siconos(const std::string& path, ProblemPointer problem);

}  // namespace fclib
