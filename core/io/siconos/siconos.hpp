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
// The format does not say which formulation it holds, but its sizes tell. Old files end with one
// more integer, 0 or 1 (whether A is symmetric), which is ignored. Siconos prints sparse entries
// with six digits. Here every number has as many digits as it needs to be read back equal.
#pragma once

#include <string>
#include <string_view>

#include "problem.hpp"

namespace fclib {

/// The problem in a text file, validated. Its title is the name of the file. Dense and sparse
/// matrices keep their storage; blocks are read by rows (CSR). `kind` ("local", "global_rolling")
/// says what the file holds; without it the sizes decide. Throws Error (file) that names the file
/// and the line, or Error (problem) like validate().
Problem read_siconos(const std::string& path, std::string_view kind = {});

/// The same for a text in memory. It has no title, and messages name no file.
Problem parse_siconos(std::string_view text, std::string_view kind = {});

/// Writes a text file, or replaces the old one whole, atomically. Each matrix keeps its storage,
/// except one by rows, since Siconos has no sparse text for it. If both its sides are those of the
/// contacts (W), it is written in blocks of d x d, else by columns. Duplicates are added up. Blocks
/// on the diagonal are written even if they are zero, because Siconos looks for them. Throws Error
/// (unsuitable) if the problem has bilateral constraints, Error (problem) if it is not valid, and
/// Error (file).
void write_siconos(const std::string& path, ProblemPointer problem);

}  // namespace fclib
