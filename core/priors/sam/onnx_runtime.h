#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
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

// A model that is ready to run. Any number of threads may call it at the same time.
class OnnxSession {
 public:
  // `model`: the bytes, which need not stay; `name` stands for them in errors. `runtime` must
  // outlive the session. INVALID_ARGUMENT: not a model that the library can run;
  // RESOURCE_EXHAUSTED: out of memory.
  static absl::StatusOr<std::unique_ptr<OnnxSession>> Create(const OnnxRuntime& runtime,
                                                             std::string_view model,
                                                             std::string name, int num_threads);
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
