#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/math/activation.h"
#include "kernels/math/frame.h"
#include "tests/kernels/backend_test.h"
#include "tests/kernels/network_reference.h"
#include "tests/kernels/test_scene.h"

// Layers of image networks against the same in double, with shapes that fill no tile: on every
// backend with floats, and on CUDA also with Halves, whose inputs are rounded before both.

namespace pepeseg {
namespace {

struct NetworkCase : BackendCase {
  Precision precision;
};
class NetworkTest : public BackendTestOf<NetworkCase> {
 protected:
  Precision precision() const { return GetParam().precision; }
  NetworkBuffer Values(int64_t count, uint64_t seed, float scale = 1) {
    std::vector<float> values = RandomValues(count, seed);
    for (float& value : values) value *= scale;
    return {*backend_, precision(), values};
  }
  Buffer<float> Floats(int64_t count, uint64_t seed) {
    return Upload(*backend_, RandomValues(count, seed));
  }
  NetworkBuffer Zeros(int64_t count) { return {*backend_, precision(), count}; }

  // Compares with the reference: errors within the precision's share of the largest value.
  void ExpectClose(const NetworkBuffer& got, const std::vector<double>& want) {
    const std::vector<float> values = got.Download();
    ASSERT_EQ(values.size(), want.size());
    double largest = 0, error = 0;
    for (size_t i = 0; i < want.size(); ++i) {
      largest = std::max(largest, std::abs(want[i]));
      const double difference = std::abs(static_cast<double>(values[i]) - want[i]);
      // A comparison with NaN must fail.
      error = difference <= error ? error : difference;
      ASSERT_FALSE(std::isnan(values[i])) << i;
    }
    EXPECT_LE(error, largest * (precision() == Precision::kHalf ? 2e-3 : 1e-5));
    EXPECT_GT(largest, 0.1);
  }
};
std::string NetworkName(const ::testing::TestParamInfo<NetworkCase>& info) {
  return std::string(info.param.name) + (info.param.precision == Precision::kHalf ? "Half" : "");
}
auto NetworkCases() {
  return ::testing::Values(NetworkCase{{"CpuAvx3", MakeCpuAvx3}, Precision::kFloat},
                           NetworkCase{{"CpuAvx2", MakeCpuAvx2}, Precision::kFloat},
                           NetworkCase{{"CpuSse4", MakeCpuSse4}, Precision::kFloat},
                           NetworkCase{{"Cuda", MakeCuda}, Precision::kFloat},
                           NetworkCase{{"Cuda", MakeCuda}, Precision::kHalf});
}
INSTANTIATE_TEST_SUITE_P(Backends, NetworkTest, NetworkCases(), NetworkName);

// Runs a Linear on random values and compares it. Residuals and biases where `args` asks for them
// by a non-zero size.
struct LinearCase {
  int64_t rows;
  int in, out;
  bool normalize = false, bias = true, residual = false, gather = false, scatter = false;
  Activation activation = Activation::kNone;
  WindowGrid windows = {};
  float input_offset = 0;
};
class LinearTest : public NetworkTest {
 protected:
  void Check(const LinearCase& c) {
    SCOPED_TRACE(testing::Message() << c.rows << " x " << c.in << " x " << c.out);
    const int64_t places = c.windows.num_places();
    std::vector<float> values = RandomValues((c.gather ? places : c.rows) * c.in, 1);
    for (float& value : values) value += c.input_offset;
    const NetworkBuffer input(*backend_, precision(), values);
    const NetworkBuffer weights = Values(int64_t{c.in} * c.out, 2, 0.3f);
    const Buffer<float> bias = Floats(c.bias ? c.out : 0, 3);
    const int64_t to = (c.scatter ? places : c.rows) * c.out;
    const NetworkBuffer residual = Values(c.residual ? to : 0, 4);
    const std::vector<float> rounded = weights.Download();
    std::vector<float> sums(c.out);
    for (size_t i = 0; i < rounded.size(); ++i) sums[i % c.out] += rounded[i];
    const Buffer<float> column_sums = Upload(*backend_, sums);
    NetworkBuffer output = Zeros(to);
    LinearArgs args = {.rows = c.rows, .in = c.in, .out = c.out};
    args.input = input.span();
    args.weights = weights.span();
    args.bias = bias.span();
    args.normalize = c.normalize;
    args.column_sums = column_sums.span();
    args.gather = c.gather;
    args.scatter = c.scatter;
    args.windows = c.windows;
    args.residual = residual.span();
    args.activation = c.activation;
    args.output = output.span();
    backend_->Linear(args);
    ExpectClose(output, LinearReference(args, {input.Download(), rounded, Download(bias),
                                               residual.Download()}));
  }
};
INSTANTIATE_TEST_SUITE_P(Backends, LinearTest, NetworkCases(), NetworkName);

TEST_P(LinearTest, IsTheProductOfRowsAndWeights) {
  Check({.rows = 1, .in = 8, .out = 8});
  Check({.rows = 77, .in = 72, .out = 40, .bias = false});
  Check({.rows = 130, .in = 160, .out = 480});
  Check({.rows = 65, .in = 640, .out = 24});
}

// Large enough for the large tiles.
TEST_P(LinearTest, MultipliesManyRows) { Check({.rows = 9001, .in = 32, .out = 256}); }

TEST_P(LinearTest, AddsAResidualBeforeTheActivation) {
  Check({.rows = 77, .in = 64, .out = 72, .residual = true, .activation = Activation::kGelu});
  Check({.rows = 77, .in = 64, .out = 72, .residual = true, .activation = Activation::kRelu});
}

TEST_P(LinearTest, NormalizesRows) {
  Check({.rows = 77, .in = 40, .out = 72, .normalize = true});
  Check({.rows = 150, .in = 320, .out = 64, .normalize = true, .activation = Activation::kGelu});
  // A mean of 2, four times the deviation.
  Check({.rows = 70, .in = 160, .out = 64, .normalize = true, .input_offset = 2});
}

TEST_P(LinearTest, GathersAndScattersWindows) {
  const WindowGrid windows = {2, 10, 17, 7};  // padded to 14 x 21: six windows an image
  Check({.rows = windows.num_tokens(),
         .in = 40,
         .out = 96,
         .normalize = true,
         .gather = true,
         .windows = windows});
  Check({.rows = windows.num_tokens(),
         .in = 96,
         .out = 40,
         .residual = true,
         .scatter = true,
         .windows = windows});
}

TEST_P(LinearTest, WritesFloatsOnRequest) {
  const NetworkBuffer input = Values(20 * 16, 1), weights = Values(16 * 8, 2);
  NetworkBuffer output(*backend_, Precision::kFloat, 20 * 8);
  LinearArgs args = {.rows = 20, .in = 16, .out = 8};
  args.input = input.span();
  args.weights = weights.span();
  args.output = output.span();
  backend_->Linear(args);
  const std::vector<double> want =
      LinearReference(args, {input.Download(), weights.Download(), {}, {}});
  const std::vector<float> got = output.Download();
  for (size_t i = 0; i < got.size(); ++i) EXPECT_NEAR(got[i], want[i], 1e-5);
}

TEST_P(NetworkTest, NormalizesLayers) {
  for (const int channels : {8, 40, 256}) {
    const NetworkBuffer input = Values(int64_t{19} * channels, 1, 200);
    const Buffer<float> scale = Floats(channels, 2), shift = Floats(channels, 3);
    NetworkBuffer output = Zeros(int64_t{19} * channels);
    LayerNormArgs args = {.rows = 19, .channels = channels};
    args.input = input.span();
    args.scale = scale.span();
    args.shift = shift.span();
    args.output = output.span();
    backend_->LayerNorm(args);
    ExpectClose(output,
                LayerNormReference(args, input.Download(), Download(scale), Download(shift)));
  }
}

TEST_P(NetworkTest, ConvolvesAtOddSizes) {
  for (const int stride : {1, 2}) {
    for (const auto& [height, width] : {std::pair(1, 1), {5, 9}, {16, 13}}) {
      Convolve3x3Args args = {2, height, width, 16, 40, stride};
      const NetworkBuffer input = Values(int64_t{2} * height * width * 16, 1);
      const NetworkBuffer weights = Values(int64_t{9} * 16 * 40, 2, 0.3f);
      const Buffer<float> bias = Floats(40, 3);
      NetworkBuffer output =
          Zeros(int64_t{2} * ConvolvedExtent(height, stride) * ConvolvedExtent(width, stride) * 40);
      args.input = input.span();
      args.weights = weights.span();
      args.bias = bias.span();
      args.activation = stride == 2 ? Activation::kGelu : Activation::kNone;
      args.output = output.span();
      backend_->Convolve3x3(args);
      ExpectClose(output,
                  ConvolveReference(args, input.Download(), weights.Download(), Download(bias)));
    }
  }
}

TEST_P(NetworkTest, ConvolvesChannelsByThemselves) {
  for (const int stride : {1, 2}) {
    for (const auto& [height, width] : {std::pair(1, 1), {5, 9}, {16, 13}}) {
      DepthwiseConvolveArgs args = {2, height, width, 40, stride};
      const NetworkBuffer input = Values(int64_t{2} * height * width * 40, 1);
      const Buffer<float> weights = Floats(9 * 40, 2), bias = Floats(40, 3);
      NetworkBuffer output =
          Zeros(int64_t{2} * ConvolvedExtent(height, stride) * ConvolvedExtent(width, stride) * 40);
      args.input = input.span();
      args.weights = weights.span();
      args.bias = bias.span();
      args.activation = stride == 1 ? Activation::kGelu : Activation::kNone;
      args.output = output.span();
      backend_->DepthwiseConvolve(args);
      ExpectClose(output,
                  DepthwiseReference(args, input.Download(), Download(weights), Download(bias)));
    }
  }
}

TEST_P(NetworkTest, AttendsWithinWindows) {
  for (const int tokens : {1, 49, 64, 65, 196}) {
    SCOPED_TRACE(tokens);
    WindowAttentionArgs args = {.num_windows = 3, .tokens = tokens, .heads = 2};
    args.bias_stride = (tokens + 7) / 8 * 8;
    const NetworkBuffer qkv = Values(int64_t{3} * tokens * 2 * 3 * kHeadSize, 1, 3);
    const NetworkBuffer bias = Values(int64_t{2} * tokens * args.bias_stride, 2, 2);
    NetworkBuffer output = Zeros(int64_t{3} * tokens * 2 * kHeadSize);
    args.qkv = qkv.span();
    args.bias = bias.span();
    args.output = output.span();
    backend_->WindowAttention(args);
    ExpectClose(output, AttentionReference(args, qkv.Download(), bias.Download()));
  }
}

// A photograph of half the frame's size, in which every other pixel of the frame is known.
TEST_P(NetworkTest, PreparesFrames) {
  constexpr int kExtent = 64;
  const auto value = [](int y, int x, int c) { return (y * 7 + x * 3 + c * 50) % 256; };
  const auto normalized = [](double byte, int c) {
    constexpr double kMean[] = {123.675, 116.28, 103.53}, kDeviation[] = {58.395, 57.12, 57.375};
    return (byte - kMean[c]) / kDeviation[c];
  };
  // Same size, and a third of the size: the mean over 3 x 3 pixels.
  for (const int scale : {1, 3}) {
    const int height = 40 * scale, width = kExtent * scale;
    std::vector<uint8_t> photo;
    for (int i = 0; i < height * width * 3; ++i) {
      photo.push_back(static_cast<uint8_t>(value(i / 3 / width, i / 3 % width, i % 3)));
    }
    const Buffer<uint8_t> pixels(*backend_, std::span<const uint8_t>(photo));
    NetworkBuffer output = Zeros(kExtent * kExtent * kFrameChannels);
    backend_->PrepareFrame({pixels.span(), height, width, kExtent, output.span()});
    std::vector<double> want;
    for (int i = 0; i < kExtent * kExtent * kFrameChannels; ++i) {
      const int c = i % kFrameChannels, x = i / kFrameChannels % kExtent,
                y = i / kFrameChannels / kExtent;
      double sum = 0;
      for (int k = 0; k < scale * scale && c < 3; ++k) {
        sum += value(y * scale + k / scale, x * scale + k % scale, c);
      }
      want.push_back(c < 3 && y < 40 ? normalized(std::nearbyint(sum / scale / scale), c) : 0);
    }
    ExpectClose(output, want);
  }
}

TEST(Activations, HaveTheErrorsTheyState) {
  for (float x = -8; x <= 8; x += 0.001f) {
    ASSERT_NEAR(Erf(x), std::erf(static_cast<double>(x)), 4e-7) << x;
    const double gelu =
        static_cast<double>(x) / 2 * (1 + std::erf(static_cast<double>(x) / M_SQRT2));
    ASSERT_NEAR(Gelu(x), gelu, 4e-7 * std::max(1.0f, std::abs(x))) << x;
  }
  EXPECT_TRUE(std::isnan(Gelu(std::numeric_limits<float>::quiet_NaN())));
}

}  // namespace
}  // namespace pepeseg
