#include "core/priors/sam/onnx_graph.h"

#include <algorithm>
#include <optional>
#include <set>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/priors/sam/onnx_fields.h"

namespace pepeseg {
namespace {

// The graph is edited on the wire format of protobuf: fields that are not changed are copied as
// bytes, and no weight is parsed.

void AppendVarint(uint64_t value, std::string& out) {
  for (; value >= 128; value >>= 7) out.push_back(static_cast<char>(value | 128));
  out.push_back(static_cast<char>(value));
}

void AppendBytes(uint64_t number, std::string_view content, std::string& out) {
  AppendVarint(number << 3 | kBytes, out);
  AppendVarint(content.size(), out);
  out.append(content);
}

void AppendNumber(uint64_t number, uint64_t value, std::string& out) {
  AppendVarint(number << 3 | kVarint, out);
  AppendVarint(value, out);
}

// Returns a serialised ValueInfoProto: a name, and a TypeProto with a Tensor of floats.
std::string ValueInfo(const OnnxValue& value) {
  constexpr uint64_t kFloat = 1;
  std::string shape, tensor, type, info;
  for (const int64_t size : value.shape) {
    std::string dimension;
    // A dimension without a value is free.
    if (size >= 0) AppendNumber(1, static_cast<uint64_t>(size), dimension);
    AppendBytes(1, dimension, shape);
  }
  AppendNumber(1, kFloat, tensor);
  AppendBytes(2, shape, tensor);
  AppendBytes(1, tensor, type);
  AppendBytes(1, value.name, info);
  AppendBytes(2, type, info);
  return info;
}

struct Node {
  std::vector<std::string_view> inputs, outputs;  // names of tensors
  std::vector<std::string_view> others;           // other fields, whole
};

// A GraphProto that can be changed. Views point into the model and the edit, which must outlive it.
class Graph {
 public:
  // Returns false when the bytes are not a message. Drops the graph's inputs, outputs and shapes of
  // inner tensors; the latter would be wrong after the edit and are optional.
  bool Parse(std::string_view bytes) {
    OnnxFieldReader fields(bytes);
    while (const std::optional<OnnxField> field = fields.Next()) {
      if (field->number == kGraphNode) {
        if (!ParseNode(field->content)) return false;
      } else if (field->number != kGraphInput && field->number != kGraphOutput &&
                 field->number != kGraphValueInfo) {
        if (field->number == kGraphInitializer) ParseInitializer(field->content);
        others_.push_back(field->whole);
      }
    }
    return fields.ok();
  }

  void Rewire(const std::map<std::string, std::string>& rewired) {
    for (Node& node : nodes_) {
      for (std::string_view& input : node.inputs) {
        // Only inputs are renamed: nodes whose outputs nobody reads any longer are dropped by
        // KeepNeeded.
        const auto found = rewired.find(std::string(input));
        if (found != rewired.end()) input = found->second;
      }
    }
  }

  // Drops nodes that no output needs. Returns a needed tensor that is neither an input, a weight
  // nor computed by a node; empty when there is none. One pass from the last node to the first
  // suffices, because ONNX demands that nodes are listed in the order in which they run.
  std::string KeepNeeded(const OnnxGraphEdit& edit) {
    std::set<std::string_view> needed;
    for (const OnnxValue& output : edit.outputs) needed.insert(output.name);
    std::vector<Node> kept;
    for (auto node = nodes_.rbegin(); node != nodes_.rend(); ++node) {
      const auto makes = [&](std::string_view output) { return needed.contains(output); };
      if (std::none_of(node->outputs.begin(), node->outputs.end(), makes)) continue;
      // What a node makes is no longer needed by the nodes before it.
      for (const std::string_view output : node->outputs) needed.erase(output);
      needed.insert(node->inputs.begin(), node->inputs.end());
      kept.push_back(std::move(*node));
    }
    std::reverse(kept.begin(), kept.end());
    nodes_ = std::move(kept);
    for (const OnnxValue& input : edit.inputs) needed.erase(input.name);
    for (const std::string_view tensor : needed) {
      // An empty name stands for an optional input that is left out.
      if (!tensor.empty() && !initializers_.contains(tensor)) return std::string(tensor);
    }
    return "";
  }

  std::string Serialize(const OnnxGraphEdit& edit) const {
    std::string graph;
    for (const Node& node : nodes_) {
      std::string bytes;
      for (const std::string_view input : node.inputs) AppendBytes(kNodeInput, input, bytes);
      for (const std::string_view output : node.outputs) AppendBytes(kNodeOutput, output, bytes);
      for (const std::string_view other : node.others) bytes.append(other);
      AppendBytes(kGraphNode, bytes, graph);
    }
    for (const std::string_view other : others_) graph.append(other);
    for (const OnnxValue& input : edit.inputs) AppendBytes(kGraphInput, ValueInfo(input), graph);
    for (const OnnxValue& output : edit.outputs) {
      AppendBytes(kGraphOutput, ValueInfo(output), graph);
    }
    return graph;
  }

 private:
  bool ParseNode(std::string_view bytes) {
    Node node;
    OnnxFieldReader fields(bytes);
    while (const std::optional<OnnxField> field = fields.Next()) {
      if (field->number == kNodeInput) {
        node.inputs.push_back(field->content);
      } else if (field->number == kNodeOutput) {
        node.outputs.push_back(field->content);
      } else {
        node.others.push_back(field->whole);
      }
    }
    nodes_.push_back(std::move(node));
    return fields.ok();
  }
  void ParseInitializer(std::string_view bytes) {
    OnnxFieldReader fields(bytes);
    while (const std::optional<OnnxField> field = fields.Next()) {
      if (field->number == kTensorName) initializers_.insert(field->content);
    }
  }

  std::vector<Node> nodes_;
  std::vector<std::string_view> others_;     // other fields, whole: weights, names
  std::set<std::string_view> initializers_;  // names of weights
};

}  // namespace

absl::StatusOr<std::string> EditOnnxGraph(std::string_view model, const OnnxGraphEdit& edit,
                                          absl::string_view name) {
  std::string edited;
  bool has_graph = false;
  OnnxFieldReader fields(model);
  while (const std::optional<OnnxField> field = fields.Next()) {
    if (field->number != kModelGraph) {
      edited.append(field->whole);
      continue;
    }
    Graph graph;
    if (!graph.Parse(field->content)) break;
    graph.Rewire(edit.rewired);
    const std::string missing = graph.KeepNeeded(edit);
    if (!missing.empty()) {
      return absl::InvalidArgumentError(
          absl::StrCat(name, ": not the expected model: it has no tensor ", missing));
    }
    AppendBytes(kModelGraph, graph.Serialize(edit), edited);
    has_graph = true;
  }
  if (fields.ok() && has_graph) return edited;
  return absl::InvalidArgumentError(absl::StrCat(name, ": not an ONNX model, or cut off"));
}

}  // namespace pepeseg
