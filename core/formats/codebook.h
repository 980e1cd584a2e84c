#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/thread_pool.h"

namespace pepeseg {

// The 256 numbers that stand for many, ascending. Some may be equal.
using Codebook = std::array<float, 256>;

// Returns the numbers that stand for `values`: themselves, if they are at most 256 different ones,
// else means of intervals, by Lloyd's algorithm. The intervals at its start are as dense as the
// cube root of the density of the values, which for many numbers gives the least mean squared error
// (Panter and Dite, 1951). All are 0 for no values.
Codebook MakeCodebook(std::vector<float> values);

// Returns the index of the number nearest to `value`.
uint8_t NearestCode(const Codebook& codebook, float value);

// A number of vectors that stand for many.
struct Palette {
  size_t num_dimensions = 0;
  std::vector<float> entries;    // [num_entries, num_dimensions]
  std::vector<uint32_t> labels;  // for each of the vectors, its entry

  size_t num_entries() const { return num_dimensions == 0 ? 0 : entries.size() / num_dimensions; }
};

// Divides vectors, [count, num_dimensions], into at most `max_entries` sets, at least 1, whose
// means are the entries. Begins with one set, and divides those with the greatest sums of squared
// errors in two, across their principal axis. The result is the same for any number of threads.
Palette MakePalette(std::span<const float> vectors, size_t num_dimensions, size_t max_entries,
                    ThreadPool& pool);

}  // namespace pepeseg
