#include "core/priors/sam/onnx_graph.h"

#include <algorithm>
#include <optional>
#include <set>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

// The graph is edited on the wire format of protobuf: fields that are not changed are copied as
// bytes, so that neither onnx.proto nor the protobuf library is needed, and no weight is parsed.

// Field numbers of onnx.proto, and wire types.
constexpr uint64_t kModelGraph = 7;
constexpr uint64_t kGraphNode = 1, kGraphInitializer = 5, kGraphInput = 11, kGraphOutput = 12,
                   kGraphValueInfo = 13;
constexpr uint64_t kNodeInput = 1, kNodeOutput = 2;
constexpr uint64_t kTensorName = 8;
constexpr uint64_t kVarint = 0, kFixed64 = 1, kBytes = 2, kFixed32 = 5;

struct Field {
  uint64_t number = 0;
  std::string_view content;  // bytes of a kBytes field; empty for other wire types
  std::string_view whole;    // the field with its tag
};

// Reads the fields of a message one after the other. Views point into the message's bytes.
class FieldReader {
 public:
  explicit FieldReader(std::string_view bytes) : rest_(bytes) {}

  // Returns nullopt at the end, and when the bytes are not a message: see ok().
  std::optional<Field> Next() {
    if (rest_.empty() || !ok_) return std::nullopt;
    const std::string_view start = rest_;
    Field field;
    // Tag: field number << 3 | wire type. Groups (3 and 4) are obsolete and not in ONNX.
    const uint64_t tag = Varint();
    field.number = tag >> 3;
    switch (tag & 7) {
      case kVarint:
        Varint();
        break;
      case kFixed64:
        Take(8);
        break;
      case kBytes:
        field.content = Take(Varint());
        break;
      case kFixed32:
        Take(4);
        break;
      default:
        ok_ = false;
    }
    field.whole = start.substr(0, start.size() - rest_.size());
    return ok_ ? std::optional(field) : std::nullopt;
  }
  bool ok() const { return ok_; }

 private:
  uint64_t Varint() {
    uint64_t value = 0;
    // At most 10 bytes: a longer number is refused instead of shifted out of range.
    for (int shift = 0; shift < 64; shift += 7) {
      if (rest_.empty()) break;
      const auto byte = static_cast<uint8_t>(rest_.front());
      rest_.remove_prefix(1);
      value |= static_cast<uint64_t>(byte & 127) << shift;
      if (byte < 128) return value;
    }
    ok_ = false;
    return 0;
  }
  std::string_view Take(uint64_t size) {
    // A length that exceeds the message is that of a damaged or hostile file.
    if (size > rest_.size()) {
      ok_ = false;
      return {};
    }
    const std::string_view taken = rest_.substr(0, size);
    rest_.remove_prefix(size);
    return taken;
  }

  std::string_view rest_;
  bool ok_ = true;
};

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
    FieldReader fields(bytes);
    while (const std::optional<Field> field = fields.Next()) {
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
    FieldReader fields(bytes);
    while (const std::optional<Field> field = fields.Next()) {
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
    FieldReader fields(bytes);
    while (const std::optional<Field> field = fields.Next()) {
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
  FieldReader fields(model);
  while (const std::optional<Field> field = fields.Next()) {
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
