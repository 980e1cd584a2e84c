#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace pepeseg {

// Agglomerative clustering of directions. Piece i points along sums[i], [num_pieces, 32], of any
// length: that is its weight. Time and again the two of the largest cosine are joined, and their
// sums added, as long as it is over `join_cosine`; of equal ones the two of the lowest numbers.
// Answers the new number of each piece, 0.., in the order of the pieces that come first in them.
// Memory in proportion to the square of the pieces. A sum of zeros is joined to nothing.
std::vector<int32_t> JoinPieces(std::span<const float> sums, double join_cosine);

}  // namespace pepeseg
