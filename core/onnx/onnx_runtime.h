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

// The file's name in the folder that deploy/sam.sh has made.
inline constexpr char kOnnxLibrary[] = "libonnxruntime.so.1";

// Microsoft's ONNX Runtime as a library that is loaded at run time: neither its headers nor its
// library are needed to build or start pepeseg.
class OnnxRuntime {
 public:
  // Loads a libonnxruntime.so of version 1.17 or later. Returns FAILED_PRECONDITION, with the file
  // and the reason, when it does not load or is another or an older library. The library stays
  // loaded until the process ends.
  static absl::StatusOr<std::unique_ptr<OnnxRuntime>> Load(const std::filesystem::path& library);
  ~OnnxRuntime();

 private:
  friend class OnnxSession;
  struct Calls;
  explicit OnnxRuntime(std::unique_ptr<Calls> calls);
  std::unique_ptr<Calls> calls_;
};

// A tensor of floats in row-major order.
struct OnnxTensor {
  std::vector<int64_t> shape;
  std::vector<float> values;
};

struct OnnxInput {
  const char* name;
  std::vector<int64_t> shape;
  std::span<const float> values;  // as many as the product of the shape
};

struct OnnxSessionOptions {
  int num_threads = 1;  // threads of one run, with the caller's
};

// A model that is ready to run. Thread-safe: any number of threads may call it at the same time.
class OnnxSession {
 public:
  // Loads a model from its bytes, which need not outlive the call; `name` stands for them in
  // messages. `runtime` must outlive the session. Returns INVALID_ARGUMENT when the library cannot
  // run the model, and RESOURCE_EXHAUSTED when out of memory.
  static absl::StatusOr<std::unique_ptr<OnnxSession>> Create(const OnnxRuntime& runtime,
                                                             std::string_view model,
                                                             std::string name,
                                                             const OnnxSessionOptions& options);
  ~OnnxSession();

  // Runs the model and returns the outputs of these names, in their order. Returns CANCELLED after
  // Interrupt, INVALID_ARGUMENT with the library's message, or RESOURCE_EXHAUSTED.
  absl::StatusOr<std::vector<OnnxTensor>> Run(std::span<const OnnxInput> inputs,
                                              std::span<const char* const> outputs) const;

  // Ends the runs in progress, each before its next operator, and makes later ones fail.
  void Interrupt() const;

 private:
  struct State;
  explicit OnnxSession(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace pepeseg
