#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

// A float tensor that is an input or an output of a graph.
struct OnnxValue {
  std::string name;
  std::vector<int64_t> shape;  // a dimension of -1 may have any size
};

// Changes to the graph of a model.
struct OnnxGraphEdit {
  // Replaced inputs of nodes: nodes that read tensor `first` read tensor `second` instead.
  std::map<std::string, std::string> rewired;
  // Inputs and outputs of the graph afterwards; all others go. An output may be any tensor.
  std::vector<OnnxValue> inputs, outputs;
};

// Returns the bytes of an ONNX model, a protobuf message, with its graph changed. Nodes that no
// output needs are dropped; weights are copied as they are. Returns INVALID_ARGUMENT when the bytes
// are not such a message or a needed tensor has no source; `name` stands for the model in messages.
absl::StatusOr<std::string> EditOnnxGraph(std::string_view model, const OnnxGraphEdit& edit,
                                          absl::string_view name);

}  // namespace pepeseg
