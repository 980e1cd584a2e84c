#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <vector>

#include "tests/kernels/backend_test.h"
#include "tests/kernels/central_differences.h"
#include "tests/kernels/rendered.h"

// Compares the CUDA backend with the CPU's on scenes too large for the reference, and tests what
// only CUDA does: tile-entry capacity, sequences and branches.

namespace pepeseg {
namespace {

class CudaAgainstCpuTest : public CudaAndCpuTest {};

// Bounds of a comparison. A splat at the very edge of its reach, or a pixel at the very end of its
// transmittance, may be decided either way. This affects few pixels (the band), each by at most
// what such a splat contributes, and in both directions.
struct Band {
  double inside;   // largest difference outside the band
  double share;    // largest share of values in the band
  double in_band;  // largest difference in the band
  double mean;     // largest absolute value of the signed mean
};

// Compares two images value by value.
void ExpectClose(const std::vector<float>& got, const std::vector<float>& want, const Band& band) {
  ASSERT_EQ(got.size(), want.size());
  double mean = 0, largest = 0, largest_in_band = 0;
  size_t num_in_band = 0;
  for (size_t i = 0; i < want.size(); ++i) {
    const double difference = double{got[i]} - want[i];
    ASSERT_TRUE(std::isfinite(got[i])) << i;
    mean += difference / static_cast<double>(want.size());
    if (std::abs(difference) > band.inside) {
      ++num_in_band;
      largest_in_band = std::max(largest_in_band, std::abs(difference));
    } else {
      largest = std::max(largest, std::abs(difference));
    }
  }
  EXPECT_LE(static_cast<double>(num_in_band), band.share * static_cast<double>(want.size()));
  EXPECT_LE(largest_in_band, band.in_band);
  EXPECT_LE(std::abs(mean), band.mean);
}

// Makes nine of sixteen Gaussians degenerate, invisible, huge or needles.
HostGaussians WithDegenerateOnes(HostGaussians scene) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  for (int64_t i = 0; i + 16 <= scene.count; i += 16) {
    for (int k = 0; k < 4; ++k) scene.At(kRotationPlane + k, i) = 0;
    scene.At(kMeanPlane, i + 1) = kNan;
    scene.At(kLogScalePlane, i + 2) = 85;
    scene.At(kLogScalePlane + 1, i + 3) = -60;
    scene.At(kOpacityPlane, i + 4) = -30;
    scene.At(kMeanPlane + 2, i + 5) = -8;
    scene.At(kShPlane + 7, i + 6) = std::numeric_limits<float>::infinity();
    scene.At(kLogScalePlane + 2, i + 7) = 3;  // fills the image
    scene.At(kOpacityPlane, i + 7) = -4;
    scene.At(kLogScalePlane, i + 8) = 0;  // a needle
    scene.At(kLogScalePlane + 1, i + 8) = scene.At(kLogScalePlane + 2, i + 8) = -12;
  }
  return scene;
}

// True for Gaussians of WithDegenerateOnes that fill the image and for needles a scene unit long.
// Their gradients are differences of far larger sums; even the CPU's instruction sets differ by up
// to the size of the gradient.
bool IsHugeOrNeedle(int64_t i) { return i % 16 == 7 || i % 16 == 8; }

struct Case {
  const char* name;
  HostGaussians scene;
  PinholeView view;
  bool inverse_depth = false;
  bool (*is_ill_conditioned)(int64_t) = nullptr;  // in float: gradients need only be finite
};

std::vector<Case> Cases() {
  return {
      {"small", RandomScene({.count = 20'000, .min_scale = 0.004f, .max_scale = 0.03f}),
       TestView(323, 217)},
      {"large", RandomScene({.count = 3'000, .max_scale = 0.3f, .seed = 5}), TestView(200, 150)},
      {"opaque",
       RandomScene({.count = 6'000, .min_opacity_logit = 2, .max_opacity_logit = 7, .seed = 6}),
       TestView(160, 171)},
      {"degenerate", WithDegenerateOnes(RandomScene({.count = 4'000, .seed = 7})),
       TestView(190, 130), false, IsHugeOrNeedle},
      {"inverse depth", RandomScene({.count = 3'000, .max_scale = 0.3f, .seed = 8}),
       TestView(200, 150), true}};
}

TEST_F(CudaAgainstCpuTest, RendersAndDifferentiatesLikeTheCpu) {
  for (const Case& c : Cases()) {
    SCOPED_TRACE(c.name);
    Rendered cpu(*cpu_, c.scene, c.view), cuda(*cuda_, c.scene, c.view);
    cpu.inverse_depth = cuda.inverse_depth = c.inverse_depth;
    cpu.Render();
    cuda.Render();
    // Which Gaussians are culled must not depend on the device.
    EXPECT_EQ(cuda.Counter(kNumVisible), cpu.Counter(kNumVisible));
    EXPECT_EQ(cuda.Counter(kNumCulledDegenerate), cpu.Counter(kNumCulledDegenerate));
    // The slack of the extent (kExtentSlack) rounds differently.
    EXPECT_NEAR(static_cast<double>(cuda.Counter(kNumTileEntries)),
                static_cast<double>(cpu.Counter(kNumTileEntries)),
                1e-4 * static_cast<double>(cpu.Counter(kNumTileEntries)) + 2);
    ExpectClose(Download(cuda.color), Download(cpu.color), {2e-5, 2e-3, 3.0 / 255, 2e-6});
    ExpectClose(Download(cuda.alpha), Download(cpu.alpha), {1e-5, 2e-3, 1.5 / 255, 2e-6});
    ExpectClose(Download(cuda.depth), Download(cpu.depth), {6e-5, 2e-3, 6.0 / 255, 6e-6});

    const int64_t num_pixels = cpu.alpha.size();
    const auto color_grad = RandomValues(3 * num_pixels, 1),
               alpha_grad = RandomValues(num_pixels, 2);
    const auto depth_grad = RandomValues(num_pixels, 3);
    cpu.Backward(color_grad, alpha_grad, depth_grad);
    cuda.Backward(color_grad, alpha_grad, depth_grad);
    const auto want = cpu.ParameterGradient(), got = cuda.ParameterGradient();
    EXPECT_EQ(cuda.Counter(kNumSkippedGradientRows), 0);
    for (int plane = 0; plane < NumPlanes(c.scene.sh_degree); ++plane) {
      std::vector<double> got_rows, want_rows;
      for (int64_t i = 0; i < c.scene.count; ++i) {
        const float row = got[plane * c.scene.count + i];
        ASSERT_TRUE(std::isfinite(row));
        if (c.is_ill_conditioned != nullptr && c.is_ill_conditioned(i)) continue;
        got_rows.push_back(row);
        want_rows.push_back(want[plane * c.scene.count + i]);
      }
      EXPECT_LT(RelativeError(got_rows, want_rows), 2e-3) << "plane " << plane;
    }
  }
}

TEST_F(CudaAgainstCpuTest, ListsTheSameEntriesInTheSameOrder) {
  for (const Case& c : Cases()) {
    SCOPED_TRACE(c.name);
    Rendered cpu(*cpu_, c.scene, c.view), cuda(*cuda_, c.scene, c.view);
    cpu.Render();
    cuda.Render();
    // With another number of entries they cannot be compared one by one.
    if (cuda.Counter(kNumTileEntries) != cpu.Counter(kNumTileEntries)) continue;
    EXPECT_EQ(Download(cuda.scratch.visible_gaussian), Download(cpu.scratch.visible_gaussian));
    EXPECT_EQ(Download(cuda.scratch.tile_first_entry), Download(cpu.scratch.tile_first_entry));
    const auto got = Download(cuda.scratch.entry_visible),
               want = Download(cpu.scratch.entry_visible);
    // Depths that are equal within rounding may be in either order.
    size_t num_moved = 0;
    for (size_t i = 0; i < want.size(); ++i) num_moved += got[i] != want[i];
    EXPECT_LT(static_cast<double>(num_moved), 1e-3 * static_cast<double>(want.size()));
  }
}

// Results of a training that must be equal to the last bit.
struct Bytes {
  std::vector<float> color, gaussians, moment2;
};
// Trains five steps with this tile-entry capacity.
Bytes Train(Backend& backend, const HostGaussians& host, int64_t tile_entry_capacity) {
  Rendered scene(backend, host, TestView(200, 150));
  for (int step = 0; step < 5; ++step) {
    scene.tile_entry_capacity = tile_entry_capacity;
    scene.Render();
    scene.Backward(RandomValues(3 * 200 * 150, step));
    backend.Update(scene.MakeUpdateArgs());
  }
  return {Download(scene.color), Download(scene.gaussians), Download(scene.moment2)};
}

TEST_F(CudaAgainstCpuTest, GivesTheSameBytesEachTimeAndWithAGivenCapacity) {
  const HostGaussians host = RandomScene({.count = 5'000, .max_scale = 0.1f});
  const Bytes once = Train(*cuda_, host, 0), again = Train(*cuda_, host, 0);
  EXPECT_EQ(once.color, again.color);
  EXPECT_EQ(once.gaussians, again.gaussians);
  EXPECT_EQ(once.moment2, again.moment2);
  const Bytes kept = Train(*cuda_, host, 1'000'000);
  EXPECT_EQ(once.color, kept.color);
  EXPECT_EQ(once.gaussians, kept.gaussians);
}

// Trains six steps, as graphs or directly. All memory is allocated while the graph is recorded.
// Views of two sizes alternate, so that the graph that is kept has to be updated to another number
// of tiles.
Bytes TrainInSequences(Backend& backend, const HostGaussians& host, bool in_sequences) {
  Rendered scene(backend, host, TestView(200, 150));
  constexpr int64_t kRoom = 1'000'000;
  scene.tile_entry_capacity = kRoom;
  for (int step = 0; step < 6; ++step) {
    scene.view = step % 3 == 2 ? TestView(120, 150) : TestView(200, 150);
    const auto num_values = int64_t{3} * scene.view.width * scene.view.height;
    const Buffer<float> color_grad(backend, std::span<const float>(RandomValues(num_values, step)));
    const auto ops = [&] {
      scene.Render();
      backend.RenderBackward(
          {.view = scene.view, .color_grad = color_grad.span(), .scratch = &scene.scratch});
      backend.Update(scene.MakeUpdateArgs());
    };
    if (in_sequences) {
      backend.Sequence(0, ops);
    } else {
      ops();
    }
  }
  return {Download(scene.color), Download(scene.gaussians), Download(scene.moment2)};
}

TEST_F(CudaAgainstCpuTest, GivesTheSameBytesInASequence) {
  const HostGaussians host = RandomScene({.count = 5'000, .max_scale = 0.1f});
  const Bytes direct = TrainInSequences(*cuda_, host, false);
  const Bytes sequence = TrainInSequences(*cuda_, host, true);
  EXPECT_EQ(direct.color, sequence.color);
  EXPECT_EQ(direct.gaussians, sequence.gaussians);
  EXPECT_EQ(direct.moment2, sequence.moment2);
}

// Trains `num_parts` scenes of different sizes for three steps, as branches of a sequence or one
// after the other. There may be more parts than branches.
std::vector<Bytes> TrainInBranches(Backend& backend, const HostGaussians& host, int num_parts,
                                   bool in_branches) {
  std::vector<std::unique_ptr<Rendered>> scenes;
  for (int part = 0; part < num_parts; ++part) {
    scenes.push_back(std::make_unique<Rendered>(backend, host, TestView(200 - 10 * part, 150)));
    scenes.back()->tile_entry_capacity = 1'000'000;
  }
  for (int step = 0; step < 3; ++step) {
    std::vector<Buffer<float>> color_grads;
    std::vector<std::function<void()>> parts;
    for (int part = 0; part < num_parts; ++part) {
      Rendered& scene = *scenes[part];
      const auto num_values = int64_t{3} * scene.view.width * scene.view.height;
      color_grads.emplace_back(backend,
                               std::span<const float>(RandomValues(num_values, step + part)));
      parts.push_back([&backend, &scene, color_grad = color_grads.back().span()] {
        scene.Render();
        backend.RenderBackward(
            {.view = scene.view, .color_grad = color_grad, .scratch = &scene.scratch});
        backend.Update(scene.MakeUpdateArgs());
      });
    }
    if (in_branches) {
      // A graph of its own for each number of parts.
      backend.Sequence(num_parts, [&] { backend.Branches(parts); });
    } else {
      for (const auto& part : parts) part();
    }
  }
  std::vector<Bytes> results;
  for (const auto& scene : scenes) {
    results.push_back(
        {Download(scene->color), Download(scene->gaussians), Download(scene->moment2)});
  }
  return results;
}

TEST_F(CudaAgainstCpuTest, GivesTheSameBytesInBranches) {
  const HostGaussians host = RandomScene({.count = 3'000, .max_scale = 0.1f});
  for (const int num_parts : {1, 2, kMaxBranches + 3}) {
    const auto direct = TrainInBranches(*cuda_, host, num_parts, false);
    const auto branches = TrainInBranches(*cuda_, host, num_parts, true);
    for (int part = 0; part < num_parts; ++part) {
      SCOPED_TRACE(part);
      EXPECT_EQ(direct[part].color, branches[part].color);
      EXPECT_EQ(direct[part].gaussians, branches[part].gaussians);
      EXPECT_EQ(direct[part].moment2, branches[part].moment2);
    }
  }
}

TEST_F(CudaAgainstCpuTest, ChangesNothingAfterAnOverflowedRender) {
  HostGaussians host = RandomScene({.count = 500, .min_scale = 0.01f, .max_scale = 0.02f});
  Rendered scene(*cuda_, host, TestView(200, 150));
  scene.Render();
  // Larger Gaussians need more entries than the first render had.
  const int64_t num_entries = scene.Counter(kNumTileEntries);
  for (int64_t i = 0; i < host.count; ++i) {
    for (int k = 0; k < 3; ++k) host.At(kLogScalePlane + k, i) = std::log(0.3f);
  }
  scene.gaussians.Upload(host.planes);
  scene.tile_entry_capacity = num_entries;
  scene.Render();
  EXPECT_GT(scene.Counter(kNumTileEntries), 4 * num_entries);
  EXPECT_EQ(scene.Counter(kNumOverflowedRenders), 1);
  for (const float alpha : Download(scene.alpha)) ASSERT_EQ(alpha, 0);
  scene.Backward(RandomValues(3 * 200 * 150, 1));
  cuda_->Update(scene.MakeUpdateArgs());
  EXPECT_EQ(Download(scene.gaussians), host.planes);
  EXPECT_EQ(Download(scene.num_steps), std::vector<int32_t>(500));
  Buffer<float> sums = Upload(*cuda_, std::vector<float>(500, 3));
  cuda_->AddWeights({.scratch = &scene.scratch, .num_planes = 1, .sums = sums.span()});
  EXPECT_EQ(Download(sums), std::vector<float>(500, 3));

  // A step of another view, which has not overflowed, is done all the same.
  Rendered other(*cuda_, host, TestView(120, 150));
  other.Render();
  other.Backward(RandomValues(3 * 120 * 150, 1));
  const UpdateStep steps[] = {{.view = scene.view, .scratch = &scene.scratch},
                              {.view = other.view, .scratch = &other.scratch}};
  UpdateArgs args = other.MakeUpdateArgs();
  args.steps = steps;
  cuda_->Update(args);
  EXPECT_EQ(Download(other.num_steps), std::vector<int32_t>(500, 1));

  // Making room repeats the render, and that many entries are then enough capacity.
  scene.tile_entry_capacity = 0;
  scene.Render();
  scene.tile_entry_capacity = scene.Counter(kNumTileEntries);
  scene.Render();
  EXPECT_EQ(scene.Counter(kNumOverflowedRenders), 1);
  scene.Backward(RandomValues(3 * 200 * 150, 1));
  cuda_->Update(scene.MakeUpdateArgs());
  EXPECT_NE(Download(scene.gaussians), host.planes);
}

TEST_F(CudaAgainstCpuTest, GathersRows) {
  const HostGaussians host = RandomScene({.count = 50, .sh_degree = 1});
  const std::vector<int32_t> source = {3, 1, 49, 0, 3}, numbers(50, 7);
  const std::vector<uint8_t> is_zero = {0, 1, 0, 0, 0};
  for (Backend* backend : {cpu_.get(), cuda_.get()}) {
    Buffer<float> from = Upload(*backend, host.planes);
    Buffer<float> to(*backend, 5 * NumPlanes(1));
    const Buffer<int32_t> rows(*backend, std::span<const int32_t>(source));
    const Buffer<uint8_t> zero(*backend, std::span<const uint8_t>(is_zero));
    const Buffer<int32_t> number_from(*backend, std::span<const int32_t>(numbers));
    Buffer<int32_t> number_to(*backend, 5);
    backend->GatherRows({.source = rows.span(),
                         .is_zero = zero.span(),
                         .from = PlanesIn(from, host),
                         .to = {to.span().data, 5, 5, 1},
                         .number_from = number_from.span(),
                         .number_to = number_to.span()});
    EXPECT_EQ(Download(number_to), (std::vector<int32_t>{7, 0, 7, 7, 7}));
    const auto got = Download(to);
    for (int plane = 0; plane < NumPlanes(1); ++plane) {
      for (int i = 0; i < 5; ++i) {
        ASSERT_EQ(got[plane * 5 + i], is_zero[i] != 0 ? 0 : host.At(plane, source[i]));
      }
    }
  }
}

TEST(CudaBackend, ReportsWhyThereIsNoDevice) {
  std::string error;
  const auto backend = MakeCudaBackend({.device = 1000}, &error);
  EXPECT_EQ(backend, nullptr);
  EXPECT_NE(error.find("CUDA"), std::string::npos);
}

}  // namespace
}  // namespace pepeseg
