#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

// The weights of an ONNX model: the float tensors that it holds as initializers or as values of
// Constant nodes. A weight is found by the node that uses it, because exporters number weights but
// name nodes after the network's layers. Movable. Not thread-safe: reading a weight marks it.
//
// Weights must be stored as raw little-endian floats in the file itself, as PyTorch exports them.
class OnnxWeights {
 public:
  // Reads a model from its bytes; `name` stands for it in messages. Returns INVALID_ARGUMENT when
  // the bytes are not an ONNX model, are cut off, or a float tensor's values do not fit its shape.
  static absl::StatusOr<OnnxWeights> Parse(std::string model, std::string name);
  // Reads a model file of at most 1 GiB. Returns also the errors of ReadFile.
  static absl::StatusOr<OnnxWeights> Read(const std::filesystem::path& file);

  // Returns input `index` of the node that makes tensor `output`. Returns INVALID_ARGUMENT if
  // that node or input does not exist, is not a weight, has another shape, or has been read before.
  absl::StatusOr<std::vector<float>> Input(absl::string_view output, int index,
                                           std::span<const int64_t> shape);
  absl::StatusOr<std::vector<float>> Input(absl::string_view output, int index,
                                           std::initializer_list<int64_t> shape) {
    return Input(output, index, std::span(shape.begin(), shape.size()));
  }

  // Returns the shape of that input, which is then not marked as read. Errors are those of Input.
  absl::StatusOr<std::vector<int64_t>> Shape(absl::string_view output, int index) const;

  // Returns the number of weights with more than one value that were not read yet.
  int num_unread() const;
  // Returns INVALID_ARGUMENT with the name of a weight that was not read: such a model is not the
  // expected one. Weights of one value, as epsilons, may stay unread.
  absl::Status CheckAllRead() const;

 private:
  struct Tensor {
    std::vector<int64_t> shape;
    std::string_view raw;  // little-endian floats
    bool read = false;
  };

  OnnxWeights() = default;
  bool ParseGraph(std::string_view bytes);
  bool ParseNode(std::string_view bytes);
  // Adds the tensor under its own name, or under `as` if that is not empty. False: not a tensor.
  bool ParseTensor(std::string_view bytes, std::string_view as);
  absl::StatusOr<std::string_view> NameOf(absl::string_view output, int index) const;
  absl::Status Unexpected(absl::string_view what) const;

  std::string name_;
  std::vector<char> model_;  // views point into it; a vector's bytes stay where they are when moved
  std::map<std::string_view, Tensor, std::less<>> tensors_;
  std::map<std::string_view, std::vector<std::string_view>, std::less<>> inputs_;  // by output
};

}  // namespace pepeseg
