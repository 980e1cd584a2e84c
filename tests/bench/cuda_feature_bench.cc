// Measures one step of stage two on a CUDA device with synthetic blend rows: total and by kernel.
// Usage:
//   pepeseg_cuda_feature_bench [pixels] [scales] [gaussians] [entries a row] [steps]

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "kernels/backend.h"
#include "tests/bench/bench_clock.h"

namespace pepeseg {
namespace {

constexpr int kNumBatches = 32;
constexpr int kNumObjects = 10, kPartsOfObject = 6;

struct BenchSize {
  int num_pixels, num_scales, num_gaussians, row_entries, num_steps;
};

template <class T>
Buffer<T> Upload(Backend& backend, const std::vector<T>& values) {
  return Buffer<T>(backend, std::span<const T>(values));
}

// Pixels of objects made of parts, with random blend rows. Rows of one object share Gaussians more
// often than others, so that there is something to learn.
struct Batch {
  Batch(Backend& backend, const BenchSize& size, uint64_t seed);

  Buffer<int32_t> first, gaussian, cell;
  Buffer<float> row_weight, pixel_weight, alpha, scales;
  Buffer<uint64_t> labels;
  int num_scales;
  // From TransposeRows.
  Buffer<int32_t> column_gaussian, column_first, column_pixel;
  Buffer<float> column_weight;

  RowSpan Rows() const { return {first.span(), gaussian.span(), row_weight.span()}; }
  void Transpose(Backend& backend, int64_t num_gaussians) {
    backend.TransposeRows({.rows = Rows(),
                           .num_gaussians = num_gaussians,
                           .gaussian = &column_gaussian,
                           .first = &column_first,
                           .pixel = &column_pixel,
                           .weight = &column_weight});
  }
};

Batch::Batch(Backend& backend, const BenchSize& size, uint64_t seed) : num_scales(size.num_scales) {
  std::mt19937_64 random(seed);
  const auto uniform = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
  constexpr int kPatches = kNumObjects * kPartsOfObject;
  std::vector<int32_t> firsts = {0}, gaussians, cells;
  std::vector<float> weights, pixel_weights, alphas, scale_values;
  for (int p = 0; p < size.num_pixels; ++p) {
    cells.push_back(static_cast<int32_t>(random() % kPatches));
    pixel_weights.push_back(1 / (200.0f + 100.0f * static_cast<float>(cells.back())));
    alphas.push_back(0.85f + 0.15f * uniform());
    const int count = size.row_entries / 2 + static_cast<int>(random() % (size.row_entries + 1));
    for (int e = 0; e < count; ++e) {
      gaussians.push_back(static_cast<int32_t>(random() % size.num_gaussians));
      weights.push_back(2 * uniform() / static_cast<float>(count));
    }
    firsts.push_back(static_cast<int32_t>(gaussians.size()));
  }
  std::vector<uint64_t> label_words;
  for (int scale = 0; scale < size.num_scales; ++scale) {
    scale_values.push_back(uniform());
    for (int i = 0; i < kPatches; ++i) {
      const uint64_t part = uint64_t{1} << (i % 50), object = uint64_t{1} << (50 + i % kNumObjects);
      const float part_scale = 0.2f + 0.005f * static_cast<float>(i);
      label_words.push_back(scale_values.back() <= part_scale ? part : part | object);
    }
  }
  first = Upload(backend, firsts);
  gaussian = Upload(backend, gaussians);
  cell = Upload(backend, cells);
  row_weight = Upload(backend, weights);
  pixel_weight = Upload(backend, pixel_weights);
  alpha = Upload(backend, alphas);
  scales = Upload(backend, scale_values);
  labels = Upload(backend, label_words);
}

std::vector<float> Noise(int64_t count) {
  std::mt19937 random(7);
  std::vector<float> values(count);
  for (float& value : values) value = 0.04f * (static_cast<float>(random() >> 8) * 0x1p-24f - 0.5f);
  return values;
}

class Training {
 public:
  Training(Backend& backend, const BenchSize& size)
      : backend_(backend),
        size_(size),
        features_(Upload(backend, Noise(int64_t{size.num_gaussians} * kFeatureSize))),
        moment1_(backend, features_.size()),
        moment2_(backend, features_.size()),
        last_step_(backend, size.num_gaussians),
        gate_(backend, kGateSize),
        gate_moment1_(backend, kGateSize),
        gate_moment2_(backend, kGateSize),
        gate_grad_(backend, kGateSize),
        pixel_features_(backend, int64_t{size.num_pixels} * kFeatureSize),
        pixel_grad_(backend, pixel_features_.size()),
        sums_(backend, kNumPairLossSums) {
    constexpr int kMaxSteps = 100'000;
    std::vector<float> terms(kMaxSteps);
    for (int t = 1; t < kMaxSteps; ++t) {
      terms[t] = static_cast<float>(std::sqrt(1 - std::pow(0.999, t)) / (1 - std::pow(0.9, t)));
    }
    correction_ = Upload(backend, terms);
    rates_.correction = correction_.span();
    for (int i = 0; i < kNumBatches; ++i) {
      batches_.emplace_back(backend, size, i + 1);
      batches_.back().Transpose(backend, size.num_gaussians);
    }
  }

  void Step(bool transpose) {
    Batch& batch = batches_[step_ % kNumBatches];
    if (transpose) batch.Transpose(backend_, size_.num_gaussians);
    const FeatureState state = {features_.span(), moment1_.span(), moment2_.span(),
                                last_step_.span()};
    backend_.FeatureCatchUp({batch.column_gaussian.span(), rates_, step_, state});
    backend_.FeatureRows({batch.Rows(), features_.span(), pixel_features_.span()});
    backend_.PairLoss({.pixel_features = pixel_features_.span(),
                       .pixel_weight = batch.pixel_weight.span(),
                       .pixel_alpha = batch.alpha.span(),
                       .pixel_cell = batch.cell.span(),
                       .labels = batch.labels.span(),
                       .num_cells = kNumObjects * kPartsOfObject,
                       .label_words = 1,
                       .scales = batch.scales.span(),
                       .gate = gate_.span(),
                       .pair_seed = static_cast<uint32_t>(step_),
                       .pixel_grad = pixel_grad_.span(),
                       .gate_grad = gate_grad_.span(),
                       .sums = sums_.span()});
    backend_.FeatureUpdate({.columns = {batch.column_gaussian.span(), batch.column_first.span(),
                                        batch.column_pixel.span(), batch.column_weight.span()},
                            .pixel_grad = pixel_grad_.span(),
                            .gate_grad = gate_grad_.span(),
                            .rates = rates_,
                            .step = ++step_,
                            .state = state,
                            .gate = gate_.span(),
                            .gate_moment1 = gate_moment1_.span(),
                            .gate_moment2 = gate_moment2_.span()});
  }

  std::vector<double> Sums() const {
    std::vector<double> sums(kNumPairLossSums);
    sums_.Download(std::span<double>(sums));
    return sums;
  }

 private:
  Backend& backend_;
  BenchSize size_;
  int step_ = 0;  // updates done
  FeatureRates rates_;
  std::vector<Batch> batches_;
  Buffer<float> correction_, features_, moment1_, moment2_;
  Buffer<int32_t> last_step_;
  Buffer<float> gate_, gate_moment1_, gate_moment2_, gate_grad_, pixel_features_, pixel_grad_;
  Buffer<double> sums_;
};

// Returns the time of a step, median over repeats, with steps queued one after another.
double StepUs(Backend& backend, Training& training, int num_steps, bool transpose) {
  std::vector<double> repeats;
  for (int repeat = 0; repeat < 7; ++repeat) {
    backend.Sync();
    const double start = NowMs();
    for (int step = 0; step < num_steps; ++step) training.Step(transpose);
    backend.Sync();
    repeats.push_back(1e3 * (NowMs() - start) / num_steps);
  }
  std::nth_element(repeats.begin(), repeats.begin() + 3, repeats.end());
  return repeats[3];
}

void PrintLosses(const Training& training) {
  const std::vector<double> sums = training.Sums();
  const auto mean = [&](PairLossSum sum, PairLossSum count) {
    return sums[count] == 0 ? 0 : sums[sum] / sums[count];
  };
  std::printf("positive %.4f of %.0f, negative %.4f of %.0f, norm %.4f\n",
              mean(kPositiveLoss, kNumPositives), sums[kNumPositives],
              mean(kNegativeLoss, kNumNegatives), sums[kNumNegatives],
              mean(kNormLoss, kNumNormPixels));
}

int Main(std::span<char*> argv) {
  const auto number = [&](size_t i, int otherwise) {
    return argv.size() > i ? std::atoi(argv[i]) : otherwise;
  };
  const BenchSize size = {number(1, 1000), number(2, 10), number(3, 700'000), number(4, 30),
                          number(5, 256)};
  std::string error;
  {
    const auto backend = MakeCudaBackend({}, &error);
    if (backend == nullptr) {
      std::fprintf(stderr, "%s\n", error.c_str());
      return 1;
    }
    Training training(*backend, size);
    training.Step(false);
    PrintLosses(training);
    std::printf("%s: %d pixels, %d scales, %d Gaussians, about %d entries a row\n",
                backend->name().c_str(), size.num_pixels, size.num_scales, size.num_gaussians,
                size.row_entries);
    for (const bool transpose : {false, true}) {
      std::printf("step: %.1f us%s\n", StepUs(*backend, training, size.num_steps, transpose),
                  transpose ? ", with TransposeRows" : "");
    }
    PrintLosses(training);
    std::printf("%.0f MB in use\n", 1e-6 * static_cast<double>(backend->bytes_in_use()));
    if (!backend->error().empty()) std::printf("ERROR %s\n", backend->error().c_str());
  }
  std::vector<KernelTime> times;
  const auto backend = MakeCudaBackend({.kernel_times = &times}, &error);
  Training training(*backend, size);
  for (int step = 0; step < kNumBatches; ++step) training.Step(true);
  backend->Sync();
  times.clear();
  for (int step = 0; step < size.num_steps; ++step) training.Step(true);
  backend->Sync();
  std::printf("| kernel | us |\n|---|---|\n");
  for (const KernelTime& time : times) {
    std::printf("| %s | %.1f |\n", time.name.c_str(), 1e3 * time.ms / size.num_steps);
  }
  return 0;
}

}  // namespace
}  // namespace pepeseg

int main(int argc, char** argv) {
  return pepeseg::Main(std::span<char*>(argv, static_cast<size_t>(argc)));
}
