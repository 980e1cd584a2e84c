#include <gtest/gtest.h>

#include <limits>
#include <thread>
#include <vector>

#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

struct DecomposeTest : ShelfModel {
  Reply<v1::DecomposeModelResponse> Decompose(const std::vector<double>& scales) const {
    v1::DecomposeModelRequest request;
    request.set_model(kModel);
    request.mutable_scales()->Add(scales.begin(), scales.end());
    return Call(&SegmentationStub::DecomposeModel, request);
  }
};

TEST_F(DecomposeTest, FindsEachSquareAtEveryLevel) {
  ASSERT_OK_AND_ASSIGN(auto answer, Decompose({}));
  EXPECT_EQ(answer.model(), "scenes/shelf/models/1");
  EXPECT_TRUE(answer.timing().has_compute());
  ASSERT_EQ(answer.levels_size(), 3);
  const double scales[] = {0.01, 0.5, 1};
  for (int i = 0; i < 3; ++i) {
    const auto& level = answer.levels(i);
    EXPECT_EQ(level.scale_quantile(), scales[i]);
    EXPECT_NEAR(level.scale_units(), scales[i], 0.01);
    EXPECT_EQ(level.num_unassigned(), 0);
    ASSERT_EQ(level.segments_size(), 2);
    for (int k = 0; k < 2; ++k) {
      EXPECT_EQ(level.segments(k).id(), k + 1);
      EXPECT_EQ(level.segments(k).parent(), i < 2 ? k + 1 : 0);
      EXPECT_EQ(level.segments(k).num_gaussians(), 10'000);
    }
  }
  const auto& red = answer.levels(0).segments(0);
  EXPECT_NEAR(red.box().min().x(), -1.1, 1e-5);
  EXPECT_NEAR(red.box().max().x(), -0.11, 1e-5);
  EXPECT_NEAR(red.box().min().y(), -0.5, 1e-5);
  EXPECT_NEAR(red.box().max().z(), 2, 1e-5);
}

TEST_F(DecomposeTest, UsesTheRequestedScales) {
  ASSERT_OK_AND_ASSIGN(auto answer, Decompose({0.3}));
  ASSERT_EQ(answer.levels_size(), 1);
  EXPECT_EQ(answer.levels(0).scale_quantile(), 0.3);
  EXPECT_EQ(answer.levels(0).segments(0).parent(), 0);
}

TEST_F(DecomposeTest, AnswersConcurrentRequestsAlike) {
  ASSERT_OK_AND_ASSIGN(auto answer, Decompose({}));
  const v1::DecomposeModelResponse want = answer;
  std::vector<int> same(4);
  std::vector<std::thread> threads;
  threads.reserve(same.size());
  for (size_t t = 0; t < same.size(); ++t) {
    threads.emplace_back([&, t] {
      v1::DecomposeModelResponse got = *Decompose({});
      *got.mutable_timing() = want.timing();
      same[t] = got.SerializeAsString() == want.SerializeAsString() ? 1 : 0;
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(same, std::vector<int>(4, 1));
}

TEST_F(DecomposeTest, RefusesScalesThatAreNone) {
  EXPECT_ERROR(Decompose({0.5, 0.5}), grpc::INVALID_ARGUMENT, "scales[1]",
               "'0.5': not over the scale before, 0.5");
  EXPECT_ERROR(Decompose({0.5, 0.2}), grpc::INVALID_ARGUMENT, "scales[1]", "'0.2': not over");
  EXPECT_ERROR(Decompose({0.1, 1.5}), grpc::INVALID_ARGUMENT, "scales[1]", "not in [0, 1]");
  EXPECT_ERROR(Decompose({-0.1}), grpc::INVALID_ARGUMENT, "scales[0]", "not in [0, 1]");
  EXPECT_ERROR(Decompose({std::numeric_limits<double>::quiet_NaN()}), grpc::INVALID_ARGUMENT,
               "scales[0]", "not in [0, 1]");
  EXPECT_ERROR(Decompose({0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9}), grpc::INVALID_ARGUMENT,
               "scales", "'9': scales; allowed are 1..8");
  ASSERT_OK_AND_ASSIGN(auto answer, Decompose({0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8}));
  EXPECT_EQ(answer.levels_size(), 8);
}

TEST_F(DecomposeTest, NamesAModelThatDoesNotExist) {
  v1::DecomposeModelRequest request;
  request.set_model("scenes/shelf/models/7");
  EXPECT_ERROR(Call(&SegmentationStub::DecomposeModel, request), grpc::NOT_FOUND);
}

}  // namespace
}  // namespace pepeseg
