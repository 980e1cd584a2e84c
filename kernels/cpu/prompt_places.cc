#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/factors.h"
#include "kernels/math/activation.h"
#include "kernels/ops/prompt_network.h"

// The places' side of SAM's decoder: AttendToPlaces, UpdatePlaces and UpscaleMasks
// (kernels/ops/prompt_network.h).

namespace pepeseg {
namespace {

constexpr int kSize = kPromptChannels;
constexpr float kPlaceEpsilon = 1e-5f, kUpscaleEpsilon = 1e-6f;

// Returns where the places of a prompt begin.
int64_t FirstPlace(const ConstNetworkSpan& places, int num_places, int64_t prompt) {
  const int64_t one = int64_t{num_places} * kSize;
  return places.size == one ? 0 : prompt * one;
}

// Writes the transpose of from, [rows, columns]. Strides: values between two rows of either. Writes
// run along rows, because rows that are a power of two apart share few sets of the cache.
void Transpose(const float* from, int rows, int columns, int64_t from_stride, float* to,
               int64_t to_stride) {
  for (int column = 0; column < columns; ++column) {
    for (int row = 0; row < rows; ++row) {
      to[column * to_stride + row] = from[row * from_stride + column];
    }
  }
}

// sums = a + b, of `count` values.
void Add(const float* a, const float* b, int count, float* sums) {
  for (int i = 0; i < count; ++i) sums[i] = a[i] + b[i];
}

// Adds the bias, [size], to each of `count` rows.
void AddBias(const float* bias, int size, int count, float* rows) {
  for (int row = 0; row < count; ++row) Add(rows + row * size, bias, size, rows + row * size);
}

// Returns rows [prompts, rows, 256] with each prompt's transposed: [prompts, 256, rows].
std::vector<float> TransposedRows(const Factors& rows, int num_prompts, int num_rows) {
  std::vector<float> columns(static_cast<size_t>(num_prompts) * num_rows * kSize);
  for (int64_t first = 0; first < static_cast<int64_t>(columns.size());
       first += int64_t{num_rows} * kSize) {
    Transpose(rows.data() + first, num_rows, kSize, kSize, &columns[first], num_rows);
  }
  return columns;
}

// Upscales kNetworkRows places of a prompt to their cells' logits of all masks.
class PlaceUpscale {
 public:
  PlaceUpscale(const SimdKernels& simd, const UpscaleMasksArgs& args)
      : simd_(simd), args_(args), first_(kFirst * kSize), second_(kSecond * kUpscaledChannels) {
    const Factors first(args.first), second(args.second);
    Transpose(first.data(), kFirst, kSize, kSize, first_.data(), kFirst);
    Transpose(second.data(), kSecond, kUpscaledChannels, kUpscaledChannels, second_.data(),
              kSecond);
  }

  // Cells of a place are in the order of quarters and, in each, of their quarters.
  static constexpr int kCells = kNetworkRows * kCellsPerPlace;
  struct Memory {
    float places[kNetworkRows * kSize];  // in
    float middle[kNetworkRows * 4 * kUpscaledChannels];
    float cells[kCells * kMaskChannels];
    float logits[kCells * kPromptMasks];  // [places, cells, masks] out
  };

  void Run(const float* products, Memory& memory) const {
    constexpr int kQuarters = 4 * kNetworkRows;
    float* middle = memory.middle;
    simd_.multiply_rows({kSize, kFirst, memory.places, first_.data(), middle});
    AddBias(args_.first_bias.data, kUpscaledChannels, kQuarters, middle);
    simd_.normalize_rows(args_.norm, kUpscaledChannels, kUpscaleEpsilon, middle, kQuarters);
    simd_.activate(Activation::kGelu, middle, kQuarters * kUpscaledChannels);
    for (int row = 0; row < kQuarters; row += kNetworkRows) {
      simd_.multiply_rows({kUpscaledChannels, kSecond, middle + row * kUpscaledChannels,
                           second_.data(), memory.cells + row * kSecond});
    }
    AddBias(args_.second_bias.data, kMaskChannels, kCells, memory.cells);
    simd_.activate(Activation::kGelu, memory.cells, kCells * kMaskChannels);
    simd_.mask_logits(memory.cells, kCells, products, memory.logits);
  }

 private:
  static constexpr int kFirst = 4 * kUpscaledChannels, kSecond = 4 * kMaskChannels;

  const SimdKernels& simd_;
  const UpscaleMasksArgs& args_;
  std::vector<float> first_, second_;  // weights, [in, out]
};

// Returns the places of a square with cells that show the photograph, in reading order.
std::vector<int32_t> ShownPlaces(const UpscaleMasksArgs& args) {
  std::vector<int32_t> shown;
  for (int place = 0; place < args.side * args.side; ++place) {
    if (place / args.side * 4 < args.height && place % args.side * 4 < args.width) {
      shown.push_back(place);
    }
  }
  return shown;
}

// Copies the logits of places on to squares of the masks, [masks, 4 side, 4 side].
void Place(const float* logits, std::span<const int32_t> places, int side, float* squares) {
  const int extent = 4 * side;
  const int64_t num_cells = int64_t{extent} * extent;
  for (const int32_t place : places) {
    for (int cell = 0; cell < kCellsPerPlace; ++cell, logits += kPromptMasks) {
      // Bits of a cell: y and x of its quarter, then y and x within it.
      const int y = place / side * 4 + (cell >> 3) * 2 + (cell >> 1 & 1);
      const int x = place % side * 4 + (cell >> 2 & 1) * 2 + (cell & 1);
      float* at = squares + int64_t{y} * extent + x;
      for (int mask = 0; mask < kPromptMasks; ++mask) at[mask * num_cells] = logits[mask];
    }
  }
}

// Writes what UpscaleMasksArgs asks for of one mask's logits, [4 side, 4 side].
void WriteMask(const SimdKernels& simd, const UpscaleMasksArgs& args, int64_t mask,
               const float* logits) {
  const int extent = 4 * args.side;
  const int64_t first = mask * extent * extent;
  if (!args.logits.empty()) {
    std::copy_n(logits, int64_t{extent} * extent, args.logits.data + first);
  }
  int32_t over[3] = {};
  for (int y = 0; y < extent; ++y) {
    const int64_t cell = first + int64_t{y} * extent;
    simd.quantize_mask({logits + int64_t{y} * extent, extent, y < args.height ? args.width : 0,
                        args.quarters.data + cell, args.bits.data + cell / 32, over});
  }
  std::copy_n(over, 3, args.areas.data + mask * 3);
}

}  // namespace

void CpuBackend::AddToPlaces(const AddToPlacesArgs& args) {
  if (failed()) return;
  const Factors places(args.places);
  std::vector<float> sums(args.places.size);
  for (int64_t first = 0; first < args.places.size; first += args.offsets.size) {
    Add(places.data() + first, args.offsets.data, static_cast<int>(args.offsets.size),
        &sums[first]);
  }
  StoreAll(args.sum, 0, sums.data(), args.places.size);
}

// A task is a part of a prompt's places: the scores of all rows, then their weighted sums.
void CpuBackend::AttendToPlaces(const AttendToPlacesArgs& args) {
  if (failed()) return;
  const int num_rows = TokenRows(args.num_tokens), num_parts = PlaceParts(args.num_places);
  const int part_size = args.num_places / num_parts;
  const Factors places(args.places), positions(args.positions), rows(args.rows);
  const std::vector<float> columns = TransposedRows(rows, args.num_prompts, num_rows);
  std::vector<std::vector<float>> scores(pool_.num_threads());
  pool_.ParallelFor(int64_t{args.num_prompts} * num_parts, [&](int64_t task, int thread) {
    const int64_t prompt = task / num_parts, part = task % num_parts;
    const float* place =
        places.data() + FirstPlace(args.places, args.num_places, prompt) + part * part_size * kSize;
    const float* position = positions.data() + part * part_size * kSize;
    std::vector<float>& score = scores[thread];  // [rows, part_size]
    score.resize(int64_t{num_rows} * part_size);
    float with[kNetworkRows * kSize], products[kNetworkRows * kPromptHeads * kMaxTokens];
    for (int i = 0; i < part_size; i += kNetworkRows) {
      Add(place + i * kSize, position + i * kSize, kNetworkRows * kSize, with);
      simd_.multiply_rows(
          {kSize, num_rows, with, columns.data() + prompt * num_rows * kSize, products});
      Transpose(products, kNetworkRows, num_rows, num_rows, score.data() + i, part_size);
    }
    const int64_t first = task * num_rows;
    for (int row = 0; row < num_rows; ++row) {
      simd_.exp_row(score.data() + int64_t{row} * part_size, part_size,
                    args.sums.best.data[first + row], args.sums.total.data[first + row]);
    }
    for (int row = 0; row < num_rows; row += kNetworkRows) {
      simd_.multiply_rows({part_size, kSize, score.data() + int64_t{row} * part_size, place,
                           args.sums.sums.data + (first + row) * kSize});
    }
  });
}

// A task is kNetworkRows places of a prompt. `updated` may be the memory of `places`.
void CpuBackend::UpdatePlaces(const UpdatePlacesArgs& args) {
  if (failed()) return;
  const int num_tasks = args.num_places / kNetworkRows, num_rows = TokenRows(args.num_tokens);
  const Factors places(args.places), positions(args.positions), keys(args.keys);
  const Factors values(args.values);
  const std::vector<float> columns = TransposedRows(keys, args.num_prompts, num_rows);
  pool_.ParallelFor(int64_t{args.num_prompts} * num_tasks, [&](int64_t task, int) {
    const int64_t prompt = task / num_tasks, i = task % num_tasks * kNetworkRows;
    const float* place =
        places.data() + FirstPlace(args.places, args.num_places, prompt) + i * kSize;
    float x[kNetworkRows * kSize], scores[kNetworkRows * kPromptHeads * kMaxTokens];
    float weights[kNetworkRows * kPromptHeads * kMaxTokens];
    Add(place, positions.data() + i * kSize, kNetworkRows * kSize, x);
    simd_.multiply_rows({kSize, num_rows, x, columns.data() + prompt * num_rows * kSize, scores});
    Transpose(scores, kNetworkRows, num_rows, num_rows, weights, kNetworkRows);
    simd_.softmax_slots({num_rows, TokenSlots(args.num_tokens), args.num_tokens,
                         args.bias.data + prompt * num_rows, weights});
    Transpose(weights, num_rows, kNetworkRows, kNetworkRows, scores, num_rows);
    simd_.multiply_rows({num_rows, kSize, scores, values.data() + prompt * num_rows * kSize, x});
    Add(x, place, kNetworkRows * kSize, x);
    AddBias(args.out_bias.data, kSize, kNetworkRows, x);
    simd_.normalize_rows(args.norm, kSize, kPlaceEpsilon, x, kNetworkRows);
    const int64_t to = (prompt * args.num_places + i) * kSize;
    StoreAll(args.updated, to, x, kNetworkRows * kSize);
  });
}

// A task is a prompt.
void CpuBackend::UpscaleMasks(const UpscaleMasksArgs& args) {
  if (failed()) return;
  const int num_places = args.side * args.side;
  const int64_t num_cells = int64_t{num_places} * kCellsPerPlace;
  const Factors places(args.places);
  const PlaceUpscale upscale(simd_, args);
  const std::vector<int32_t> shown = ShownPlaces(args);
  pool_.ParallelFor(args.num_prompts, [&](int64_t prompt, int) {
    const auto memory = std::make_unique<PlaceUpscale::Memory>();
    std::vector<float> squares(kPromptMasks * num_cells);
    const float* products = args.products.data + prompt * kPromptMasks * kMaskChannels;
    for (size_t first = 0; first < shown.size(); first += kNetworkRows) {
      const auto some =
          std::span(shown).subspan(first, std::min(size_t{kNetworkRows}, shown.size() - first));
      for (size_t i = 0; i < some.size(); ++i) {
        std::copy_n(places.data() + (prompt * num_places + some[i]) * kSize, kSize,
                    memory->places + i * kSize);
      }
      upscale.Run(products, *memory);
      Place(memory->logits, some, args.side, squares.data());
    }
    for (int mask = 0; mask < kPromptMasks; ++mask) {
      WriteMask(simd_, args, prompt * kPromptMasks + mask, squares.data() + mask * num_cells);
    }
  });
}

}  // namespace pepeseg
