#include "core/formats/codebook.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>
#include <utility>

namespace pepeseg {
namespace {

constexpr size_t kCodes = std::tuple_size_v<Codebook>;

// Returns the numbers at the start of Lloyd's algorithm. The values are sorted, and not all equal.
Codebook FirstCodes(std::span<const float> values) {
  // Intervals with equal numbers of values. The density of one is 1 / width, so that the cube root
  // of the density, times the width, is width^(2/3).
  const size_t num_intervals = std::min<size_t>(values.size() - 1, 64 * kCodes);
  const auto value_at = [&](size_t i) {
    return double{values[i * (values.size() - 1) / num_intervals]};
  };
  std::vector<double> weights(num_intervals);
  for (size_t i = 0; i < num_intervals; ++i) {
    weights[i] = std::pow(value_at(i + 1) - value_at(i), 2.0 / 3);
  }
  // The share of a code. An interval has at most two, however far away one of its values is.
  constexpr int kRounds = 50;
  double share = std::accumulate(weights.begin(), weights.end(), 0.0) / kCodes;
  for (int round = 0; round < kRounds; ++round) {
    double sum = 0;
    for (double& weight : weights) sum += weight = std::min(weight, 2 * share);
    share = sum / kCodes;
  }
  Codebook codes{};
  size_t code = 0;
  double before = 0;
  for (size_t i = 0; i < num_intervals; ++i) {
    for (; weights[i] > 0 && code < kCodes; ++code) {
      const double part = ((static_cast<double>(code) + 0.5) * share - before) / weights[i];
      if (!(part <= 1)) break;
      codes[code] =
          static_cast<float>(value_at(i) + std::max(0.0, part) * (value_at(i + 1) - value_at(i)));
    }
    before += weights[i];
  }
  // The sums of floating-point numbers may leave out the last.
  for (; code < kCodes; ++code) codes[code] = values.back();
  std::ranges::sort(codes);  // rounding
  return codes;
}

// Returns the greatest value that is nearer to codes[i] than to codes[i + 1], or as near.
float Border(const Codebook& codes, size_t i) { return 0.5f * (codes[i] + codes[i + 1]); }

// A set of vectors: labels [first, first + count) of an order.
struct Cell {
  size_t first = 0, count = 0;
  double error = 0;         // sum of squared distances to the mean
  std::vector<float> mean;  // [num_dimensions]
};

// Divides the cells of MakePalette.
class CellDivider {
 public:
  CellDivider(std::span<const float> vectors, size_t num_dimensions)
      : vectors_(vectors), num_dimensions_(num_dimensions) {
    order_.resize(vectors.size() / num_dimensions);
    std::iota(order_.begin(), order_.end(), 0);
  }

  // Returns the cell of the vectors order()[first, first + count).
  Cell CellOf(size_t first, size_t count) const {
    std::vector<double> sum(num_dimensions_, 0.0);
    double squares = 0;
    for (size_t i = first; i < first + count; ++i) {
      const float* const vector = VectorAt(i);
      for (size_t k = 0; k < num_dimensions_; ++k) {
        sum[k] += double{vector[k]};
        squares += double{vector[k]} * vector[k];
      }
    }
    Cell cell = {first, count, squares, std::vector<float>(num_dimensions_)};
    for (size_t k = 0; k < num_dimensions_; ++k) {
      const double mean = sum[k] / static_cast<double>(count);
      cell.error -= mean * sum[k];
      cell.mean[k] = static_cast<float>(mean);
    }
    // Rounding leaves little of nothing, which would be divided without end.
    if (cell.error < 1e-12 * squares) cell.error = 0;
    return cell;
  }

  // Divides a cell in two. The second is empty if all its vectors are on one side. Calls for
  // different cells may run at once.
  std::pair<Cell, Cell> Divide(const Cell& cell) {
    const std::vector<float> axis = AxisOf(cell);
    std::vector<std::pair<float, uint32_t>> places(cell.count);
    for (size_t i = 0; i < cell.count; ++i) {
      const float* const vector = VectorAt(cell.first + i);
      float place = 0;
      for (size_t k = 0; k < num_dimensions_; ++k) place += axis[k] * (vector[k] - cell.mean[k]);
      places[i] = {place, order_[cell.first + i]};
    }
    const float border = BorderOf(places);
    const auto middle =
        std::stable_partition(places.begin(), places.end(),
                              [border](const auto& place) { return place.first <= border; });
    for (size_t i = 0; i < cell.count; ++i) order_[cell.first + i] = places[i].second;
    const auto below = static_cast<size_t>(middle - places.begin());
    if (below == 0 || below == cell.count) return {cell, {}};
    return {CellOf(cell.first, below), CellOf(cell.first + below, cell.count - below)};
  }

  std::span<const uint32_t> order() const { return order_; }

 private:
  const float* VectorAt(size_t i) const { return vectors_.data() + order_[i] * num_dimensions_; }

  // Returns about the principal axis of a cell: some steps of the power method on some of it.
  std::vector<float> AxisOf(const Cell& cell) const {
    constexpr size_t kMost = 512;
    constexpr int kSteps = 4;
    const size_t stride = (cell.count + kMost - 1) / kMost;
    // The first axis is the way to the vector that is farthest from the mean.
    std::vector<float> axis(num_dimensions_, 0.0f), next(num_dimensions_);
    float farthest = -1;
    for (size_t i = 0; i < cell.count; i += stride) {
      const float* const vector = VectorAt(cell.first + i);
      float squares = 0;
      for (size_t k = 0; k < num_dimensions_; ++k) {
        next[k] = vector[k] - cell.mean[k];
        squares += next[k] * next[k];
      }
      if (squares > farthest) {
        farthest = squares;
        axis = next;
      }
    }
    for (int step = 0; step < kSteps; ++step) {
      std::ranges::fill(next, 0.0f);
      for (size_t i = 0; i < cell.count; i += stride) {
        const float* const vector = VectorAt(cell.first + i);
        float place = 0;
        for (size_t k = 0; k < num_dimensions_; ++k) place += axis[k] * (vector[k] - cell.mean[k]);
        for (size_t k = 0; k < num_dimensions_; ++k) next[k] += place * (vector[k] - cell.mean[k]);
      }
      float squares = 0;
      for (const float value : next) squares += value * value;
      if (!(squares > 0) || !std::isfinite(squares)) break;
      for (size_t k = 0; k < num_dimensions_; ++k) axis[k] = next[k] / std::sqrt(squares);
    }
    return axis;
  }

  // Returns the border between two sets of places, each nearer to its own mean, as far as some
  // steps of Lloyd's algorithm find it.
  static float BorderOf(const std::vector<std::pair<float, uint32_t>>& places) {
    constexpr int kSteps = 4;
    float border = 0;  // the mean of all
    for (int step = 0; step < kSteps; ++step) {
      double sums[2] = {};
      int64_t counts[2] = {};
      for (const auto& [place, row] : places) {
        const int side = place <= border ? 0 : 1;
        sums[side] += double{place};
        ++counts[side];
      }
      if (counts[0] == 0 || counts[1] == 0) break;
      border = static_cast<float>(0.5 * (sums[0] / static_cast<double>(counts[0]) +
                                         sums[1] / static_cast<double>(counts[1])));
    }
    return border;
  }

  const std::span<const float> vectors_;
  const size_t num_dimensions_;
  std::vector<uint32_t> order_;
};

}  // namespace

Codebook MakeCodebook(std::vector<float> values) {
  Codebook codes{};
  if (values.empty()) return codes;
  std::ranges::sort(values);
  std::vector<float> different;
  for (const float value : values) {
    if (different.empty() || value != different.back()) different.push_back(value);
    if (different.size() > kCodes) break;
  }
  if (different.size() <= kCodes) {
    codes.fill(different.back());
    std::ranges::copy(different, codes.begin());
    return codes;
  }
  codes = FirstCodes(values);
  std::vector<double> sums(values.size() + 1, 0.0);  // of the values before each
  for (size_t i = 0; i < values.size(); ++i) sums[i + 1] = sums[i] + double{values[i]};
  constexpr int kSteps = 200;
  for (int step = 0; step < kSteps; ++step) {
    size_t first = 0;
    Codebook next = codes;
    for (size_t i = 0; i < kCodes; ++i) {
      const auto end = i + 1 == kCodes
                           ? values.end()
                           : std::upper_bound(values.begin() + static_cast<ptrdiff_t>(first),
                                              values.end(), Border(codes, i));
      const auto last = static_cast<size_t>(end - values.begin());
      if (last > first) {
        next[i] =
            static_cast<float>((sums[last] - sums[first]) / static_cast<double>(last - first));
      }
      first = last;
    }
    std::ranges::sort(next);  // rounding of sums
    if (next == codes) break;
    codes = next;
  }
  return codes;
}

uint8_t NearestCode(const Codebook& codebook, float value) {
  const auto above =
      static_cast<size_t>(std::ranges::lower_bound(codebook, value) - codebook.begin());
  if (above == 0) return 0;
  const size_t below = above - 1;
  if (above == kCodes) return static_cast<uint8_t>(below);
  return static_cast<uint8_t>(value - codebook[below] <= codebook[above] - value ? below : above);
}

Palette MakePalette(std::span<const float> vectors, size_t num_dimensions, size_t max_entries,
                    ThreadPool& pool) {
  Palette palette;
  palette.num_dimensions = num_dimensions;
  if (vectors.empty() || num_dimensions == 0) return palette;
  CellDivider divider(vectors, num_dimensions);
  std::vector<Cell> cells = {divider.CellOf(0, vectors.size() / num_dimensions)};
  while (cells.size() < max_entries) {
    // Each round divides the cells with at least the mean error, the greatest first.
    double error = 0;
    for (const Cell& cell : cells) error += cell.error;
    // A little less than the mean, which rounding could lift above all errors.
    const double least = (1 - 1e-9) * error / static_cast<double>(cells.size());
    std::vector<size_t> chosen;
    for (size_t i = 0; i < cells.size(); ++i) {
      if (cells[i].error > 0 && cells[i].error >= least) chosen.push_back(i);
    }
    if (chosen.empty()) break;
    std::ranges::stable_sort(
        chosen, [&cells](size_t a, size_t b) { return cells[a].error > cells[b].error; });
    chosen.resize(std::min(chosen.size(), max_entries - cells.size()));
    std::vector<Cell> added(chosen.size());
    pool.ParallelFor(static_cast<int64_t>(chosen.size()), [&](int64_t i, int) {
      const auto at = static_cast<size_t>(i);
      Cell& cell = cells[chosen[at]];
      std::tie(cell, added[at]) = divider.Divide(cell);
      if (added[at].count == 0) cell.error = 0;  // it cannot be divided
    });
    for (Cell& cell : added) {
      if (cell.count > 0) cells.push_back(std::move(cell));
    }
  }
  palette.labels.resize(divider.order().size());
  palette.entries.reserve(cells.size() * num_dimensions);
  for (size_t i = 0; i < cells.size(); ++i) {
    for (const uint32_t row : divider.order().subspan(cells[i].first, cells[i].count)) {
      palette.labels[row] = static_cast<uint32_t>(i);
    }
    palette.entries.insert(palette.entries.end(), cells[i].mean.begin(), cells[i].mean.end());
  }
  return palette;
}

}  // namespace pepeseg
