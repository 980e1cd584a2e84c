#include "core/priors/sam/onnx_weights.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/priors/sam/onnx_fields.h"

namespace pepeseg {
namespace {

constexpr uint64_t kFloatType = 1;  // TensorProto.DataType
constexpr int64_t kMaxWeightBytes = int64_t{1} << 30;
constexpr int64_t kMaxWeightValues = kMaxWeightBytes / 4;

// Returns the number of values, or -1 for a shape that no weight can have.
int64_t NumWeightValues(std::span<const int64_t> shape) {
  int64_t count = 1;
  for (const int64_t size : shape) {
    // Both factors are below 2^28, so the product fits.
    if (size < 0 || size > kMaxWeightValues) return -1;
    count *= size;
    if (count > kMaxWeightValues) return -1;
  }
  return count;
}

}  // namespace

absl::StatusOr<OnnxWeights> OnnxWeights::Parse(std::string model, std::string name) {
  OnnxWeights weights;
  weights.name_ = std::move(name);
  weights.model_.assign(model.begin(), model.end());
  bool has_graph = false, ok = true;
  OnnxFieldReader fields({weights.model_.data(), weights.model_.size()});
  while (const std::optional<OnnxField> field = fields.Next()) {
    if (field->number != kModelGraph) continue;
    has_graph = true;
    ok = ok && weights.ParseGraph(field->content);
  }
  if (ok && fields.ok() && has_graph) return weights;
  return absl::InvalidArgumentError(absl::StrCat(weights.name_, ": not an ONNX model, or cut off"));
}

absl::StatusOr<OnnxWeights> OnnxWeights::Read(const std::filesystem::path& file) {
  ASSIGN_OR_RETURN(std::string model, ReadFile(file, file.string(), kMaxWeightBytes));
  return Parse(std::move(model), file.string());
}

bool OnnxWeights::ParseGraph(std::string_view bytes) {
  OnnxFieldReader fields(bytes);
  while (const std::optional<OnnxField> field = fields.Next()) {
    if (field->number == kGraphNode && !ParseNode(field->content)) return false;
    if (field->number == kGraphInitializer && !ParseTensor(field->content, "")) return false;
  }
  return fields.ok();
}

// A Constant node is a weight with the name of its output; other attributes are not weights.
bool OnnxWeights::ParseNode(std::string_view bytes) {
  std::vector<std::string_view> inputs, outputs;
  std::string_view type, value;
  OnnxFieldReader fields(bytes);
  while (const std::optional<OnnxField> field = fields.Next()) {
    if (field->number == kNodeInput) inputs.push_back(field->content);
    if (field->number == kNodeOutput) outputs.push_back(field->content);
    if (field->number == kNodeType) type = field->content;
    if (field->number != kNodeAttribute) continue;
    std::string_view attribute, tensor;
    OnnxFieldReader parts(field->content);
    while (const std::optional<OnnxField> part = parts.Next()) {
      if (part->number == kAttributeName) attribute = part->content;
      if (part->number == kAttributeTensor) tensor = part->content;
    }
    if (!parts.ok()) return false;
    if (attribute == "value") value = tensor;
  }
  if (!fields.ok()) return false;
  for (const std::string_view output : outputs) inputs_[output] = inputs;
  if (type != "Constant" || outputs.empty() || value.empty()) return true;
  return ParseTensor(value, outputs[0]);
}

// Only floats are weights: integers are shapes and indices.
bool OnnxWeights::ParseTensor(std::string_view bytes, std::string_view as) {
  Tensor tensor;
  std::string_view name = as;
  uint64_t type = 0;
  OnnxFieldReader fields(bytes);
  while (const std::optional<OnnxField> field = fields.Next()) {
    if (field->number == kTensorShape) tensor.shape.push_back(static_cast<int64_t>(field->value));
    if (field->number == kTensorType) type = field->value;
    if (field->number == kTensorName && as.empty()) name = field->content;
    if (field->number == kTensorRaw) tensor.raw = field->content;
  }
  if (!fields.ok()) return false;
  if (type != kFloatType) return true;
  const int64_t count = NumWeightValues(tensor.shape);
  if (count < 0 || static_cast<uint64_t>(count) * sizeof(float) != tensor.raw.size()) return false;
  return tensors_.emplace(name, std::move(tensor)).second;
}

absl::Status OnnxWeights::Unexpected(absl::string_view what) const {
  return absl::InvalidArgumentError(absl::StrCat(name_, ": not the expected model: ", what));
}

absl::StatusOr<std::string_view> OnnxWeights::NameOf(absl::string_view output, int index) const {
  const auto inputs = inputs_.find(std::string_view(output.data(), output.size()));
  if (inputs == inputs_.end()) return Unexpected(absl::StrCat("no node makes ", output));
  if (index < 0 || static_cast<size_t>(index) >= inputs->second.size()) {
    return Unexpected(absl::StrCat("the node of ", output, " has no input ", index));
  }
  const std::string_view name = inputs->second[index];
  if (!tensors_.contains(name)) {
    return Unexpected(absl::StrCat("input ", index, " of ", output, " is not a weight"));
  }
  return name;
}

absl::StatusOr<std::vector<int64_t>> OnnxWeights::Shape(absl::string_view output, int index) const {
  ASSIGN_OR_RETURN(const std::string_view name, NameOf(output, index));
  return tensors_.find(name)->second.shape;
}

absl::StatusOr<std::vector<float>> OnnxWeights::Input(absl::string_view output, int index,
                                                      std::span<const int64_t> shape) {
  ASSIGN_OR_RETURN(const std::string_view name, NameOf(output, index));
  Tensor& tensor = tensors_.find(name)->second;
  if (!std::ranges::equal(tensor.shape, shape)) {
    return Unexpected(absl::StrCat("input ", index, " of ", output, " has shape [",
                                   absl::StrJoin(tensor.shape, ", "), "], not [",
                                   absl::StrJoin(shape, ", "), "]"));
  }
  if (std::exchange(tensor.read, true)) {
    return Unexpected(absl::StrCat("input ", index, " of ", output, " is used twice"));
  }
  std::vector<float> values(tensor.raw.size() / sizeof(float));
  std::memcpy(values.data(), tensor.raw.data(), tensor.raw.size());
  return values;
}

int OnnxWeights::num_unread() const {
  const auto unread = [](const auto& entry) {
    return !entry.second.read && entry.second.raw.size() > sizeof(float);
  };
  return static_cast<int>(std::count_if(tensors_.begin(), tensors_.end(), unread));
}

absl::Status OnnxWeights::CheckAllRead() const {
  for (const auto& [name, tensor] : tensors_) {
    if (!tensor.read && tensor.raw.size() > sizeof(float)) {
      return Unexpected(absl::StrCat("it has an unknown weight ", std::string(name)));
    }
  }
  return absl::OkStatus();
}

}  // namespace pepeseg
