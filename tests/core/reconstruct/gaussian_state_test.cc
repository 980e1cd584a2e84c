#include "core/reconstruct/gaussian_state.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

namespace pepeseg {
namespace {

Gaussians Numbered(int64_t count) {
  Gaussians out = Gaussians::Zero(count, 1);
  for (size_t i = 0; i < out.planes.size(); ++i) out.planes[i] = static_cast<float>(i);
  return out;
}

// Returns a span of host memory, which the CPU backend can read.
template <class T>
DeviceSpan<const T> Span(const std::vector<T>& host) {
  return {host.data(), static_cast<int64_t>(host.size())};
}

// The tests run on the CPU backend, whose memory the host may read.
void Fill(GaussianPlanes planes, float value) {
  for (int k = 0; k < NumPlanes(planes.sh_degree); ++k) {
    for (int64_t i = 0; i < planes.count; ++i) planes.Plane(k)[i] = value + static_cast<float>(i);
  }
}

TEST(GaussianState, DownloadsWhatWasUploaded) {
  const auto backend = MakeCpuBackend(1);
  const Gaussians initial = Numbered(5);
  const GaussianState state(*backend, initial);
  EXPECT_EQ(state.Download().planes, initial.planes);
}

TEST(GaussianState, RemovesTheGaussiansOfARegion) {
  const auto backend = MakeCpuBackend(1);
  GaussianState state(*backend, Numbered(4));  // Gaussian i is at (i, 4 + i, 8 + i)
  Fill(state.moment1(), 10);
  for (int i = 0; i < 4; ++i) state.num_steps()[i] = 100 + i;
  const auto is_odd = [](const Eigen::Vector3f& mean) {
    return static_cast<int>(mean.x()) % 2 == 1 && mean.z() == mean.x() + 8;
  };
  EXPECT_EQ(state.Remove(is_odd), 2);
  ASSERT_EQ(state.count(), 2);
  const Gaussians after = state.Download(), before = Numbered(4);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(state.num_steps()[i], 100 + 2 * i);
    for (int k = 0; k < NumPlanes(1); ++k) {
      EXPECT_EQ(after.Plane(k)[i], before.Plane(k)[2 * i]);
      EXPECT_EQ(state.moment1().Plane(k)[i], 10 + 2 * i);
    }
  }
  EXPECT_EQ(state.Remove(is_odd), 0);
  EXPECT_EQ(state.Remove([](const Eigen::Vector3f&) { return true; }), 0) << "all of them";
  EXPECT_EQ(state.count(), 2);
}

TEST(GaussianState, KeepsMomentsExceptThoseOfNewGaussiansWhenRearranged) {
  const auto backend = MakeCpuBackend(1);
  GaussianState state(*backend, Numbered(3));
  Fill(state.moment1(), 10);
  Fill(state.moment2(), 20);
  for (int i = 0; i < 3; ++i) {
    state.num_steps()[i] = 100 + i;
    state.stats().mean2d_grad_sum[i] = state.stats().square_sum[i] = 1;
    state.stats().num_visible[i] = 1;
  }
  const std::vector<int32_t> source = {2, 0, 0, 2};
  const std::vector<uint8_t> is_new = {0, 0, 1, 1};
  ASSERT_TRUE(state.Rearrange(Span(source), Span(is_new)));
  ASSERT_EQ(state.count(), 4);
  const Gaussians after = state.Download(), before = Numbered(3);
  const float moments1[] = {12, 10, 0, 0}, moments2[] = {22, 20, 0, 0};
  const int steps[] = {102, 100, 0, 0};
  for (int i = 0; i < 4; ++i) {
    for (int k = 0; k < NumPlanes(1); ++k) {
      EXPECT_EQ(after.Plane(k)[i], before.Plane(k)[source[i]]);
      EXPECT_EQ(state.moment1().Plane(k)[i], moments1[i]);
      EXPECT_EQ(state.moment2().Plane(k)[i], moments2[i]);
    }
    EXPECT_EQ(state.num_steps()[i], steps[i]);
    EXPECT_EQ(state.stats().mean2d_grad_sum[i], 0);
    EXPECT_EQ(state.stats().square_sum[i], 0);
    EXPECT_EQ(state.stats().num_visible[i], 0);
  }
}

TEST(GaussianState, GrowsBeyondItsStride) {
  const auto backend = MakeCpuBackend(1);
  GaussianState state(*backend, Numbered(3));
  const std::vector<int32_t> source(10'000, 1);
  ASSERT_TRUE(state.Rearrange(Span(source), Span(std::vector<uint8_t>(source.size(), 1))));
  const Gaussians after = state.Download();
  ASSERT_EQ(after.count, 10'000);
  EXPECT_EQ(after.Plane(0)[9'999], 1);
  EXPECT_EQ(after.Plane(NumPlanes(1) - 1)[9'999], Numbered(3).planes[3 * NumPlanes(1) - 2]);
}

// Appends Gaussians 2 and 0 again, with means and log scales that count from 500 in planes of 3.
TEST(GaussianState, AppendsCopiesWithNewMeansAndScales) {
  const int64_t count = 3;
  const auto backend = MakeCpuBackend(1);
  GaussianState state(*backend, Numbered(count));
  ASSERT_TRUE(state.OpenRefinement());
  Fill(state.moment1(), 10);
  Fill(state.moment2(), 20);
  for (int64_t i = 0; i < count; ++i) {
    state.num_steps()[i] = state.stats().num_visible[i] = static_cast<int32_t>(100 + i);
    state.stats().mean2d_grad_sum[i] = static_cast<float>(i);
    state.stats().square_sum[i] = static_cast<float>(10 + i);
    state.refinable()[i] = static_cast<int32_t>(i % 2);
  }
  const std::vector<int32_t> source = {2, 0};
  std::vector<float> shapes(18);
  std::iota(shapes.begin(), shapes.end(), 500.0f);
  ASSERT_TRUE(state.Append(Span(source), Span(shapes)));
  ASSERT_EQ(state.count(), count + 2);
  const Gaussians after = state.Download(), before = Numbered(count);
  for (int k = 0; k < NumPlanes(1); ++k) {
    for (int64_t i = 0; i < count; ++i) {
      ASSERT_EQ(after.Plane(k)[i], before.Plane(k)[i]);
      ASSERT_EQ(state.moment1().Plane(k)[i], static_cast<float>(10 + i));
      ASSERT_EQ(state.moment2().Plane(k)[i], static_cast<float>(20 + i));
    }
    for (int64_t i = 0; i < 2; ++i) {
      const float want = k < 6 ? static_cast<float>(500 + 3 * k + i) : before.Plane(k)[source[i]];
      EXPECT_EQ(after.Plane(k)[count + i], want);
      EXPECT_EQ(state.moment1().Plane(k)[count + i], 0);
      EXPECT_EQ(state.moment2().Plane(k)[count + i], 0);
    }
  }
  for (int64_t i = 0; i < count + 2; ++i) {
    const bool is_new = i >= count;
    ASSERT_EQ(state.num_steps()[i], is_new ? 0 : 100 + i);
    ASSERT_EQ(state.stats().num_visible[i], is_new ? 0 : 100 + i);
    ASSERT_EQ(state.stats().mean2d_grad_sum[i], is_new ? 0 : static_cast<float>(i));
    ASSERT_EQ(state.stats().square_sum[i], is_new ? 0 : static_cast<float>(10 + i));
    ASSERT_EQ(state.refinable()[i], is_new ? 0 : i % 2);
  }
}

TEST(GaussianState, AppendsBeyondItsStride) {
  const auto backend = MakeCpuBackend(1);
  const int64_t count = 1000;
  GaussianState state(*backend, Numbered(count));
  const std::vector<int32_t> source(2000, 999);
  std::vector<float> shapes(6 * 2000, 5.0f);
  ASSERT_TRUE(state.OpenRefinement());
  state.stats().num_visible[7] = 70;
  Fill(state.moment2(), 20);
  ASSERT_TRUE(state.Append(Span(source), Span(shapes)));
  const Gaussians after = state.Download(), before = Numbered(count);
  ASSERT_EQ(after.count, 3000);
  for (int k = 0; k < NumPlanes(1); ++k) {
    EXPECT_EQ(after.Plane(k)[999], before.Plane(k)[999]);
    EXPECT_EQ(after.Plane(k)[2999], k < 6 ? 5.0f : before.Plane(k)[999]);
    EXPECT_EQ(state.moment2().Plane(k)[999], 1019);
    EXPECT_EQ(state.moment2().Plane(k)[2999], 0);
  }
  EXPECT_EQ(state.stats().num_visible[7], 70);
  EXPECT_EQ(state.refinable()[999], 1);
  EXPECT_EQ(state.refinable()[1000], 0);
}

TEST(GaussianState, SetsOnlyMeansAndLogScales) {
  const auto backend = MakeCpuBackend(1);
  GaussianState state(*backend, Numbered(2));
  std::vector<float> planes(12);
  for (size_t i = 0; i < planes.size(); ++i) planes[i] = 100 + static_cast<float>(i);
  state.SetMeansAndLogScales(Span(planes));
  const Gaussians after = state.Download();
  for (int k = 0; k < NumPlanes(1); ++k) {
    for (int i = 0; i < 2; ++i) {
      const float old = Numbered(2).Plane(k)[i];
      EXPECT_EQ(after.Plane(k)[i], k < kRotationPlane ? planes[2 * k + i] : old);
    }
  }
}

TEST(GaussianState, MultipliesOpacitiesWhenFading) {
  const auto backend = MakeCpuBackend(1);
  Gaussians initial = Numbered(3);
  const float logits[] = {3, -9, 15};
  for (int i = 0; i < 3; ++i) initial.Plane(kOpacityPlane)[i] = logits[i];
  GaussianState state(*backend, initial);
  state.FadeOpacity(0.9f);
  const Gaussians after = state.Download();
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(1 / (1 + std::exp(-after.Plane(kOpacityPlane)[i])),
                0.9 / (1 + std::exp(-logits[i])), 1e-6);
  }
}

// In single precision an opacity is 1 from a logit of 17 on, and 0 below -88.
TEST(GaussianState, KeepsFadedLogitsFiniteWhereTheSigmoidSaturates) {
  const auto backend = MakeCpuBackend(1);
  Gaussians initial = Numbered(5);
  const float logits[] = {30, 1e4f, -89, -200, -1e4f};
  for (int i = 0; i < 5; ++i) initial.Plane(kOpacityPlane)[i] = logits[i];
  GaussianState state(*backend, initial);
  state.FadeOpacity(1);
  EXPECT_EQ(state.Download().planes, initial.planes);
  state.FadeOpacity(0.5f);
  const Gaussians after = state.Download();
  // Half of opacity 1 is logit 0; a very negative logit falls by log 2.
  const double want[] = {0, 0, -89 - std::log(2), -200 - std::log(2), -1e4 - std::log(2)};
  for (int i = 0; i < 5; ++i) {
    EXPECT_NEAR(after.Plane(kOpacityPlane)[i], want[i], 1e-6 * std::abs(want[i]) + 1e-6) << i;
  }
}

TEST(GaussianState, LimitsOpacitiesAndClearsTheirMoments) {
  const auto backend = MakeCpuBackend(1);
  Gaussians initial = Numbered(2);
  initial.Plane(kOpacityPlane)[0] = 3;
  initial.Plane(kOpacityPlane)[1] = -9;
  GaussianState state(*backend, initial);
  Fill(state.moment1(), 10);
  Fill(state.moment2(), 20);
  state.LimitOpacity(0.01f);
  const Gaussians after = state.Download();
  EXPECT_NEAR(1 / (1 + std::exp(-after.Plane(kOpacityPlane)[0])), 0.01, 1e-6);
  EXPECT_EQ(after.Plane(kOpacityPlane)[1], -9);
  EXPECT_EQ(after.Plane(kOpacityPlane - 1)[1], initial.Plane(kOpacityPlane - 1)[1]);
  EXPECT_EQ(after.Plane(kOpacityPlane + 1)[0], initial.Plane(kOpacityPlane + 1)[0]);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(state.moment1().Plane(kOpacityPlane)[i], 0);
    EXPECT_EQ(state.moment2().Plane(kOpacityPlane)[i], 0);
    EXPECT_EQ(state.moment1().Plane(kOpacityPlane - 1)[i], 10 + i);
    EXPECT_EQ(state.moment2().Plane(kOpacityPlane + 1)[i], 20 + i);
  }
}

}  // namespace
}  // namespace pepeseg
