#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace pepeseg {

// Microsoft's ONNX Runtime, which is loaded when it is used: nothing of it is needed to build or to
// start pepeseg.
class OnnxRuntime {
 public:
  // Loads a libonnxruntime.so of version 1.17 or later. FAILED_PRECONDITION names the file and what
  // is wrong: it does not load, or is another or an older library.
  static absl::StatusOr<std::unique_ptr<OnnxRuntime>> Load(const std::filesystem::path& library);
  ~OnnxRuntime();

 private:
  friend class OnnxSession;
  struct Calls;
  explicit OnnxRuntime(std::unique_ptr<Calls> calls);
  std::unique_ptr<Calls> calls_;
};

// A tensor of floats, row-major.
struct OnnxTensor {
  std::vector<int64_t> shape;
  std::vector<float> values;
};

struct OnnxInput {
  const char* name;
  std::vector<int64_t> shape;
  std::span<const float> values;  // as many as the shape says
};

struct OnnxSessionOptions {
  int num_threads = 1;
  // Number of the GPU that computes what it can, by the library's CUDA provider. Absent: none does.
  std::optional<int> cuda_device = std::nullopt;
};

// A model that is ready to run. Any number of threads may call it at the same time.
class OnnxSession {
 public:
  // `model`: the bytes, which need not stay; `name` stands for them in errors. `runtime` must
  // outlive the session. INVALID_ARGUMENT: not a model that the library can run, or it has no CUDA
  // provider that works; RESOURCE_EXHAUSTED: out of memory.
  static absl::StatusOr<std::unique_ptr<OnnxSession>> Create(const OnnxRuntime& runtime,
                                                             std::string_view model,
                                                             std::string name,
                                                             const OnnxSessionOptions& options);
  ~OnnxSession();

  // The outputs of those names, in their order. CANCELLED: after Interrupt.
  absl::StatusOr<std::vector<OnnxTensor>> Run(std::span<const OnnxInput> inputs,
                                              std::span<const char* const> outputs) const;

  // Ends the runs in progress, each before its next operator, and refuses later ones.
  void Interrupt() const;

 private:
  struct State;
  explicit OnnxSession(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace pepeseg
