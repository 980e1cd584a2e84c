#include "core/priors/sam/onnx_weights.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "tests/testing/fake_sam.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::ProtoBytes;
constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;

// Returns a field of a small number.
std::string ProtoNumber(int number, int value) {
  return {static_cast<char>(number << 3), static_cast<char>(value)};
}

std::string Tensor(const std::string& name, const std::vector<int>& shape,
                   const std::vector<float>& values) {
  std::string tensor;
  for (const int size : shape) tensor += ProtoNumber(1, size);
  const std::string raw(reinterpret_cast<const char*>(values.data()), values.size() * 4);
  return tensor + ProtoNumber(2, 1) + ProtoBytes(8, name) + ProtoBytes(9, raw);
}

std::string TypedNode(const std::vector<std::string>& inputs, const std::string& output,
                      const std::string& type, const std::string& attributes = "") {
  std::string node;
  for (const std::string& input : inputs) node += ProtoBytes(1, input);
  return ProtoBytes(1, node + ProtoBytes(2, output) + ProtoBytes(4, type) + attributes);
}

// Returns a model with the initializers "w" [2, 3] and "b" [2], the constant "c" [2], and the
// constant "epsilon" of one value: h = Gemm(in, w, b), out = Add(h, c).
std::string WeightModel() {
  const auto constant = [](const std::string& name, const std::string& tensor) {
    return TypedNode({}, name, "Constant",
                     ProtoBytes(5, ProtoBytes(1, "value") + ProtoBytes(5, tensor)));
  };
  return ProtoBytes(
      7, TypedNode({"in", "w", "b"}, "h", "Gemm") + constant("c", Tensor("", {2}, {7, 8})) +
             constant("epsilon", Tensor("", {}, {1e-5f})) + TypedNode({"h", "c"}, "out", "Add") +
             ProtoBytes(5, Tensor("w", {2, 3}, {1, 2, 3, 4, 5, 6})) +
             ProtoBytes(5, Tensor("b", {2}, {-1, -2})));
}

TEST(OnnxWeights, AreFoundByTheNodesThatUseThem) {
  ASSERT_OK_AND_ASSIGN(OnnxWeights weights, OnnxWeights::Parse(WeightModel(), "m.onnx"));
  EXPECT_EQ(weights.num_unread(), 3);
  ASSERT_OK_AND_ASSIGN(const auto shape, weights.Shape("h", 1));
  EXPECT_THAT(shape, ElementsAre(2, 3));
  ASSERT_OK_AND_ASSIGN(const auto w, weights.Input("h", 1, {2, 3}));
  EXPECT_THAT(w, ElementsAre(1, 2, 3, 4, 5, 6));
  ASSERT_OK_AND_ASSIGN(const auto b, weights.Input("h", 2, {2}));
  EXPECT_THAT(b, ElementsAre(-1, -2));
  EXPECT_STATUS(weights.CheckAllRead(), kInvalid,
                "m.onnx: not the expected model: it has an unknown weight c");
  OnnxWeights moved = std::move(weights);
  ASSERT_OK_AND_ASSIGN(const auto c, moved.Input("out", 1, {2}));
  EXPECT_THAT(c, ElementsAre(7, 8));
  ASSERT_OK(moved.CheckAllRead());
}

TEST(OnnxWeights, NameWhatIsNotAsExpected) {
  ASSERT_OK_AND_ASSIGN(OnnxWeights weights, OnnxWeights::Parse(WeightModel(), "m.onnx"));
  EXPECT_STATUS(weights.Input("nowhere", 1, {2}), kInvalid,
                "m.onnx: not the expected model: no node makes nowhere");
  EXPECT_STATUS(weights.Input("h", 3, {2}), kInvalid,
                "m.onnx: not the expected model: the node of h has no input 3");
  EXPECT_STATUS(weights.Input("h", 0, {2}), kInvalid,
                "m.onnx: not the expected model: input 0 of h is not a weight");
  EXPECT_STATUS(weights.Input("h", 1, {3, 2}), kInvalid,
                "m.onnx: not the expected model: input 1 of h has shape [2, 3], not [3, 2]");
  ASSERT_OK(weights.Input("h", 1, {2, 3}));
  EXPECT_STATUS(weights.Input("h", 1, {2, 3}), kInvalid,
                "m.onnx: not the expected model: input 1 of h is used twice");
}

TEST(OnnxWeights, RefuseACutModel) {
  const std::string model = WeightModel();
  for (size_t size = 0; size < model.size(); ++size) {
    EXPECT_STATUS(OnnxWeights::Parse(model.substr(0, size), "m.onnx"), kInvalid,
                  "m.onnx: not an ONNX model, or cut off");
  }
}

TEST(OnnxWeights, RefuseValuesThatDoNotFitTheirShape) {
  for (const std::vector<int>& shape : {std::vector{3}, {1}, {2, 2}, {0}}) {
    const std::string model = ProtoBytes(7, ProtoBytes(5, Tensor("w", shape, {1, 2})));
    EXPECT_STATUS(OnnxWeights::Parse(model, "m.onnx"), kInvalid,
                  "m.onnx: not an ONNX model, or cut off");
  }
}

// Damaged models must be read within their bytes: the sanitizers' builds check that.
TEST(OnnxWeights, SurviveDamagedModels) {
  const std::string model = WeightModel();
  std::mt19937_64 engine(1);
  for (int i = 0; i < 20000; ++i) {
    std::string damaged = model;
    for (int k = 0; k < 3; ++k) damaged[engine() % damaged.size()] = static_cast<char>(engine());
    absl::StatusOr<OnnxWeights> weights = OnnxWeights::Parse(damaged, "m.onnx");
    if (!weights.ok()) continue;
    const auto w = weights->Input("h", 1, {2, 3});
    EXPECT_TRUE(!w.ok() || w->size() == 6);
  }
}

TEST(OnnxWeights, AreReadFromAFile) {
  EXPECT_EQ(OnnxWeights::Read("/nonexistent/m.onnx").status().code(), absl::StatusCode::kNotFound);
}

}  // namespace
}  // namespace pepeseg
