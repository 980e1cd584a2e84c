#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
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

// Upscales one place of a prompt to its cells' logits of all masks.
class PlaceUpscale {
 public:
  explicit PlaceUpscale(const UpscaleMasksArgs& args)
      : args_(args), first_(args.first), second_(args.second) {}

  void Run(const float* place, const float* products,
           float (&logits)[kPromptMasks][kCellsPerPlace]) const {
    for (int quarter = 0; quarter < 4; ++quarter) {
      float middle[kUpscaledChannels];
      for (int out = 0; out < kUpscaledChannels; ++out) {
        const float* weight = first_.data() + (quarter * kUpscaledChannels + out) * kSize;
        middle[out] = args_.first_bias[out] + Dot(place, weight, kSize);
      }
      Normalize(args_.norm, kUpscaledChannels, kUpscaleEpsilon, middle);
      for (float& x : middle) x = Gelu(x);
      for (int part = 0; part < 4; ++part) {
        // The bits of `quarter` and `part` are the cell's: y high, x low.
        const int y = quarter / 2 * 2 + part / 2, x = quarter % 2 * 2 + part % 2;
        float cell[kMaskChannels];
        for (int out = 0; out < kMaskChannels; ++out) {
          const float* weight = second_.data() + (part * kMaskChannels + out) * kUpscaledChannels;
          cell[out] = Gelu(args_.second_bias[out] + Dot(middle, weight, kUpscaledChannels));
        }
        for (int mask = 0; mask < kPromptMasks; ++mask) {
          logits[mask][4 * y + x] = Dot(cell, products + mask * kMaskChannels, kMaskChannels);
        }
      }
    }
  }

 private:
  const UpscaleMasksArgs& args_;
  const Factors first_, second_;
};

// Writes what UpscaleMasksArgs asks for of one mask's logits, [4 side, 4 side].
void WriteMask(const UpscaleMasksArgs& args, int64_t mask, const std::vector<float>& logits) {
  const int extent = 4 * args.side;
  const int64_t num_cells = int64_t{extent} * extent;
  int32_t over[3] = {};
  for (int64_t i = 0; i < num_cells; ++i) {
    const float logit = logits[i];
    const int64_t at = mask * num_cells + i;
    if (!args.logits.empty()) args.logits[at] = logit;
    args.quarters[at] = static_cast<int8_t>(std::lround(std::clamp(logit * 4, -127.0f, 127.0f)));
    const bool counted = i % extent < args.width && i / extent < args.height;
    if (i % 32 == 0) args.bits[at / 32] = 0;
    if (!counted) continue;
    if (logit > 0) args.bits[at / 32] |= uint32_t{1} << (i % 32);
    for (int k = 0; k < 3; ++k) over[k] += logit > static_cast<float>(k - 1) ? 1 : 0;
  }
  std::copy_n(over, 3, args.areas.data + mask * 3);
}

}  // namespace

void CpuBackend::AddToPlaces(const AddToPlacesArgs& args) {
  if (failed()) return;
  const Factors places(args.places);
  for (int64_t i = 0; i < args.places.size; ++i) {
    Store(args.sum, i, places.data()[i] + args.offsets[i % args.offsets.size]);
  }
}

// A task is a row of a prompt.
void CpuBackend::AttendToPlaces(const AttendToPlacesArgs& args) {
  if (failed()) return;
  const int num_rows = TokenRows(args.num_tokens), num_parts = PlaceParts(args.num_places);
  const int part_size = args.num_places / num_parts;
  const Factors places(args.places), positions(args.positions), rows(args.rows);
  pool_.ParallelFor(int64_t{args.num_prompts} * num_rows, [&](int64_t task, int) {
    const int64_t prompt = task / num_rows, row = task % num_rows;
    const float* place = places.data() + FirstPlace(args.places, args.num_places, prompt);
    const float* key = rows.data() + task * kSize;
    for (int part = 0; part < num_parts; ++part) {
      std::vector<float> score(part_size);
      float with[kSize], best = -std::numeric_limits<float>::infinity();
      for (int i = 0; i < part_size; ++i) {
        const int64_t first = (int64_t{part} * part_size + i) * kSize;
        for (int c = 0; c < kSize; ++c) with[c] = place[first + c] + positions.data()[first + c];
        score[i] = Dot(with, key, kSize);
        best = std::max(best, score[i]);
      }
      const int64_t at = (prompt * num_parts + part) * num_rows + row;
      float* sum = args.sums.sums.data + at * kSize;
      std::fill_n(sum, kSize, 0.0f);
      float total = 0;
      for (int i = 0; i < part_size; ++i) {
        const float weight = std::exp(score[i] - best);
        total += weight;
        const float* x = place + (int64_t{part} * part_size + i) * kSize;
        for (int c = 0; c < kSize; ++c) sum[c] += weight * x[c];
      }
      args.sums.best[at] = best;
      args.sums.total[at] = total;
    }
  });
}

// A task is a row of 64 places of a prompt. `updated` may be the memory of `places`.
void CpuBackend::UpdatePlaces(const UpdatePlacesArgs& args) {
  if (failed()) return;
  constexpr int kTask = 64;
  const int num_tasks = args.num_places / kTask, num_rows = TokenRows(args.num_tokens);
  const int slots = TokenSlots(args.num_tokens);
  const Factors places(args.places), positions(args.positions), keys(args.keys);
  const Factors values(args.values);
  pool_.ParallelFor(int64_t{args.num_prompts} * num_tasks, [&](int64_t task, int) {
    const int64_t prompt = task / num_tasks;
    const int64_t from = FirstPlace(args.places, args.num_places, prompt);
    const float* key = keys.data() + prompt * num_rows * kSize;
    const float* value = values.data() + prompt * num_rows * kSize;
    const float* bias = args.bias.data + prompt * num_rows;
    for (int64_t i = task % num_tasks * kTask; i < (task % num_tasks + 1) * kTask; ++i) {
      const float* place = places.data() + from + i * kSize;
      float with[kSize], x[kSize];
      for (int c = 0; c < kSize; ++c) {
        with[c] = place[c] + positions.data()[i * kSize + c];
        x[c] = place[c] + args.out_bias[c];
      }
      for (int row = 0; row < num_rows; row += slots) {
        float weight[kMaxTokens], best = -std::numeric_limits<float>::infinity(), total = 0;
        for (int k = 0; k < args.num_tokens; ++k) {
          weight[k] = bias[row + k] + Dot(with, key + (row + k) * kSize, kSize);
          best = std::max(best, weight[k]);
        }
        for (int k = 0; k < args.num_tokens; ++k) {
          weight[k] = std::exp(weight[k] - best);
          total += weight[k];
        }
        for (int k = 0; k < args.num_tokens; ++k) {
          const float share = weight[k] / total;
          for (int c = 0; c < kSize; ++c) x[c] += share * value[(row + k) * kSize + c];
        }
      }
      Normalize(args.norm, kSize, kPlaceEpsilon, x);
      const int64_t to = (prompt * args.num_places + i) * kSize;
      for (int c = 0; c < kSize; ++c) Store(args.updated, to + c, x[c]);
    }
  });
}

// A task is a prompt.
void CpuBackend::UpscaleMasks(const UpscaleMasksArgs& args) {
  if (failed()) return;
  const int extent = 4 * args.side;
  const Factors places(args.places);
  const PlaceUpscale upscale(args);
  pool_.ParallelFor(args.num_prompts, [&](int64_t prompt, int) {
    std::vector<float> logits[kPromptMasks];
    for (std::vector<float>& mask : logits) mask.resize(static_cast<size_t>(extent) * extent);
    const float* products = args.products.data + prompt * kPromptMasks * kMaskChannels;
    for (int place = 0; place < args.side * args.side; ++place) {
      float cells[kPromptMasks][kCellsPerPlace];
      upscale.Run(places.data() + (prompt * args.side * args.side + place) * kSize, products,
                  cells);
      const int top = place / args.side * 4, left = place % args.side * 4;
      for (int mask = 0; mask < kPromptMasks; ++mask) {
        for (int i = 0; i < kCellsPerPlace; ++i) {
          logits[mask][(top + i / 4) * extent + left + i % 4] = cells[mask][i];
        }
      }
    }
    for (int mask = 0; mask < kPromptMasks; ++mask) {
      WriteMask(args, prompt * kPromptMasks + mask, logits[mask]);
    }
  });
}

}  // namespace pepeseg
