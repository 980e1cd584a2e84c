#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "core/priors/sam/device_sam.h"
#include "tests/kernels/backend_test.h"
#include "tests/testing/status_testing.h"

// Small networks of random weights, and photographs for them.
namespace pepeseg {

inline constexpr int kSmallFrame = 128;

inline EncoderShape SmallShape() {
  EncoderShape shape;
  shape.frame = kSmallFrame;
  shape.channels = {16, 16, 24, 32};
  shape.blocks = {1, 1, 1, 1};
  shape.heads = {0, 1, 2, 1};
  return shape;
}

// Random weights, the same for the same name. The decoder's estimated IoUs are near 0.8.
inline absl::StatusOr<std::vector<float>> SmallWeights(absl::string_view output, int index,
                                                       std::span<const int64_t> shape) {
  int64_t count = 1;
  for (const int64_t size : shape) count *= size;
  // Convolutions are [out, in, down, across], matrices [in, out].
  const int64_t terms = shape.size() == 4   ? count / shape[0]
                        : shape.size() == 2 ? shape[0]
                                            : int64_t{100};
  uint64_t seed = static_cast<uint64_t>(index) + 7;
  for (const char letter : output) seed = seed * 131 + static_cast<uint8_t>(letter);
  std::mt19937_64 engine(seed);
  const bool is_scale = (output.find("LayerNorm") != absl::string_view::npos && index == 1) ||
                        output == "/output_upscaling/output_upscaling.1/Mul_output_0";
  const bool is_iou = output == "/iou_prediction_head/layers.2/Gemm_output_0" && index == 2;
  std::normal_distribution<double> normal(is_scale ? 1
                                          : is_iou ? 0.8
                                                   : 0,
                                          1.3 / std::sqrt(static_cast<double>(terms)));
  std::vector<float> values(static_cast<size_t>(count));
  for (float& value : values) value = static_cast<float>(normal(engine));
  return values;
}

inline View SmallView(int width, int height, uint64_t seed) {
  std::mt19937_64 engine(seed);
  View view;
  view.photo = {width, height, 3, std::vector<uint8_t>(size_t{3} * width * height)};
  // Squares of 8 pixels, so that the encoder sees borders.
  std::vector<uint8_t> colours(size_t{3} * (width / 8 + 1) * (height / 8 + 1));
  for (uint8_t& colour : colours) colour = static_cast<uint8_t>(engine());
  for (int i = 0; i < width * height * 3; ++i) {
    const int x = i / 3 % width, y = i / 3 / width;
    view.photo.pixels[i] = colours[3 * (y / 8 * (width / 8 + 1) + x / 8) + i % 3];
  }
  return view;
}

inline std::unique_ptr<DeviceSam> MakeSmallSam(std::unique_ptr<Backend> backend) {
  const Precision precision = backend->memory().is_host ? Precision::kFloat : Precision::kHalf;
  auto encoder = EncoderNetwork::Make(SmallShape(), SmallWeights, *backend, precision);
  EXPECT_OK(encoder);
  auto decoder = DecoderNetwork::Make(kSmallFrame / 16, SmallWeights, *backend, precision);
  EXPECT_OK(decoder);
  return std::make_unique<DeviceSam>(std::move(backend), *std::move(encoder), *std::move(decoder));
}

inline std::unique_ptr<Backend> MakeTwoThreads() { return MakeCpuBackend(2); }

// Tests of a small SAM on the backends, which skip a device that the machine does not have.
class SmallSamTest : public ::testing::TestWithParam<BackendCase> {
 protected:
  void SetUp() override {
    auto backend = GetParam().make();
    if (backend == nullptr && HasFailure()) FAIL();
    if (backend == nullptr) GTEST_SKIP() << "this machine has no " << GetParam().name;
    sam_ = MakeSmallSam(std::move(backend));
  }
  std::unique_ptr<DeviceSam> sam_;
};

// A prompt by the mask of a rectangle of the photograph.
inline MaskPrompt SmallMaskPrompt(const Image& photo, int extent) {
  const auto at = [&](double x, double y) {
    return PromptPoint{static_cast<float>(x * photo.width), static_cast<float>(y * photo.height)};
  };
  MaskPrompt prompt = {{at(0.4, 0.5), at(0.3, 0.4)}, {{at(0.2, 0.3), at(0.6, 0.7)}}, {}};
  for (int i = 0; i < extent * extent; ++i) {
    const int x = i % extent, y = i / extent;
    const bool inside = x >= extent / 5 && x < extent * 3 / 5 && y > extent / 4 && y < extent / 2;
    prompt.logits.push_back(inside ? 6 : -6);
  }
  return prompt;
}

}  // namespace pepeseg
