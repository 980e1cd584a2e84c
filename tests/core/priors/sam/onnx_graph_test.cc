#include "core/priors/sam/onnx_graph.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/fake_sam.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using testing::ProtoBytes;

std::string Node(const std::string& input, const std::string& output) {
  return ProtoBytes(1, ProtoBytes(1, input) + ProtoBytes(2, output) + ProtoBytes(4, "Relu"));
}

// Returns a model with the nodes in -> a -> b -> out and a -> side, and the initializer "weight".
std::string Model() {
  const std::string graph = Node("in", "a") + Node("a", "b") + Node("a", "side") +
                            Node("b", "out") + ProtoBytes(5, ProtoBytes(8, "weight")) +
                            ProtoBytes(11, ProtoBytes(1, "in")) +
                            ProtoBytes(12, ProtoBytes(1, "out"));
  return ProtoBytes(2, "maker") + ProtoBytes(7, graph);
}

TEST(EditOnnxGraph, MakesInnerTensorsOutputsAndDropsUnneededNodes) {
  ASSERT_OK_AND_ASSIGN(const auto edited,
                       EditOnnxGraph(Model(), {{}, {{"in", {1, -1}}}, {{"b", {-1}}}}, "m.onnx"));
  EXPECT_THAT(edited, HasSubstr("maker"));
  EXPECT_THAT(edited, HasSubstr("weight"));
  EXPECT_THAT(edited, HasSubstr(Node("a", "b")));
  EXPECT_THAT(edited, Not(HasSubstr("side")));
  EXPECT_THAT(edited, Not(HasSubstr("out")));
}

TEST(EditOnnxGraph, RewiresTheInputsOfNodes) {
  const OnnxGraphEdit edit = {{{"b", "weight"}}, {{"in", {}}}, {{"out", {}}}};
  ASSERT_OK_AND_ASSIGN(const auto edited, EditOnnxGraph(Model(), edit, "m.onnx"));
  EXPECT_THAT(edited, HasSubstr(Node("weight", "out")));
  EXPECT_THAT(edited, Not(HasSubstr(Node("a", "b"))));
}

TEST(EditOnnxGraph, NamesATensorWithoutSource) {
  for (const OnnxGraphEdit& edit :
       {OnnxGraphEdit{{}, {{"in", {}}}, {{"nowhere", {}}}},
        OnnxGraphEdit{{{"b", "nowhere"}}, {{"in", {}}}, {{"out", {}}}}}) {
    EXPECT_STATUS(EditOnnxGraph(Model(), edit, "m.onnx"), absl::StatusCode::kInvalidArgument,
                  "m.onnx: not the expected model: it has no tensor nowhere");
  }
}

TEST(EditOnnxGraph, RefusesATruncatedModel) {
  const std::string model = Model();
  const OnnxGraphEdit edit = {{}, {{"in", {}}}, {{"out", {}}}};
  ASSERT_OK(EditOnnxGraph(model, edit, "m.onnx"));
  for (size_t size = 0; size < model.size(); ++size) {
    const auto edited = EditOnnxGraph(model.substr(0, size), edit, "m.onnx");
    EXPECT_THAT(std::string(edited.status().message()), HasSubstr("m.onnx: not an ONNX model"))
        << size;
  }
}

}  // namespace
}  // namespace pepeseg
