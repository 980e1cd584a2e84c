#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

// A float tensor that goes into a graph or comes out of it.
struct OnnxValue {
  std::string name;
  std::vector<int64_t> shape;  // -1: any size
};

// A change to the graph of a model.
struct OnnxGraphEdit {
  // Nodes that read tensor `first` read tensor `second` instead.
  std::map<std::string, std::string> rewired;
  // The graph's only inputs and outputs afterwards. An output may be any tensor of the graph.
  std::vector<OnnxValue> inputs, outputs;
};

// The bytes of an ONNX model (a protobuf message) with its graph changed; nodes that no output
// needs are dropped. Weights are copied as they are. INVALID_ARGUMENT: the bytes are not such a
// message, or a tensor that is needed has no source; `name` stands for the model.
absl::StatusOr<std::string> EditOnnxGraph(std::string_view model, const OnnxGraphEdit& edit,
                                          absl::string_view name);

}  // namespace pepeseg
