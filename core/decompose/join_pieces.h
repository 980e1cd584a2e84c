#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace pepeseg {

// Clusters directions agglomeratively, by their centroids. As long as the largest cosine between
// two pieces is over `join_cosine`, these two are joined and their sums added; of equal cosines the
// pair with the lowest numbers comes first. A sum of zeros is never joined.
//
// sums: [num_pieces, 32], the direction of each piece; its length is its weight. Returns the new
// number of each piece, from 0, in the order of the first pieces of the clusters. Memory grows with
// the square of num_pieces, time with its square times the number of joins at worst.
std::vector<int32_t> JoinPieces(std::span<const float> sums, double join_cosine);

}  // namespace pepeseg
