#include "core/onnx/onnx_runtime.h"

#include <dlfcn.h>

#include <atomic>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace onnx {

// The stable part of ONNX Runtime's C interface: the library returns a table of functions. Versions
// only append to it, so that the position of a function identifies it; the positions below are
// those of its C header. All objects of the library are opaque pointers. A function is called
// through a pointer of the type that its declaration in that header has.
constexpr uint32_t kApiVersion = 17;
enum Position {
  kGetErrorMessage = 2,
  kCreateEnv = 3,
  kCreateSessionFromArray = 8,
  kRun = 9,
  kCreateSessionOptions = 10,
  kDisableMemPattern = 17,
  kSetIntraOpNumThreads = 24,
  kCreateRunOptions = 39,
  kRunOptionsSetTerminate = 46,
  kCreateTensorWithData = 49,
  kGetTensorMutableData = 51,
  kGetDimensionsCount = 61,
  kGetDimensions = 62,
  kGetTensorTypeAndShape = 65,
  kCreateCpuMemoryInfo = 69,
  kReleaseEnv = 92,
  kReleaseStatus = 93,
  kReleaseMemoryInfo = 94,
  kReleaseSession = 95,
  kReleaseValue = 96,
  kReleaseRunOptions = 97,
  kReleaseTensorTypeAndShape = 99,
  kReleaseSessionOptions = 100,
  kAddSessionConfigEntry = 130,
};
constexpr int kLogErrors = 3, kArenaAllocator = 1, kDefaultMemory = 0, kFloat = 1;

using Table = void (*const*)();
struct ApiBase {
  Table (*get_api)(uint32_t version);
  const char* (*get_version)();
};

using Object = void*;
using Failure = void*;  // result of a call that can fail: null, or an object with a message

// An object of the library, freed by the function at `release`. address() is where the library
// stores the object.
class Owned {
 public:
  Owned(Table table, Position release) : table_(table), release_(release) {}
  ~Owned() { Reset(); }
  Owned(Owned&& other) noexcept
      : table_(other.table_),
        release_(other.release_),
        object_(std::exchange(other.object_, nullptr)) {}
  Owned& operator=(Owned&&) = delete;

  Object get() const { return object_; }
  Object* address() { return &object_; }

 private:
  void Reset() {
    if (object_ != nullptr) reinterpret_cast<void (*)(Object)>(table_[release_])(object_);
  }

  Table table_;
  Position release_;
  Object object_ = nullptr;
};

}  // namespace onnx

namespace {

absl::Status LoadError(const std::filesystem::path& library, absl::string_view what) {
  return absl::FailedPreconditionError(absl::StrCat(library.string(), ": ", what));
}

int64_t NumValues(std::span<const int64_t> shape) {
  int64_t count = 1;
  for (const int64_t size : shape) count *= size;
  return count;
}

}  // namespace

using namespace onnx;  // NOLINT(google-build-using-namespace): a namespace of this file

struct OnnxRuntime::Calls {
  explicit Calls(Table functions)
      : table(functions), env(functions, kReleaseEnv), memory(functions, kReleaseMemoryInfo) {}

  // Calls the function at a position, which can fail. The types of the arguments must be exactly
  // those of its declaration. Returns RESOURCE_EXHAUSTED when memory ran out, else INVALID_ARGUMENT
  // with the library's message.
  template <typename... Arguments>
  absl::Status Call(Position position, Arguments... arguments) const {
    const Failure failure =
        // The C call converts nothing: an argument of another width would be read wrongly.
        reinterpret_cast<Failure (*)(Arguments...)>(table[position])(arguments...);
    if (failure == nullptr) return absl::OkStatus();
    const std::string message =
        reinterpret_cast<const char* (*)(Failure)>(table[kGetErrorMessage])(failure);
    reinterpret_cast<void (*)(Failure)>(table[kReleaseStatus])(failure);
    // A failed allocation is recognised by the text of the library or the standard library.
    for (const char* words : {"allocate memory", "bad_alloc", "std::bad_alloc"}) {
      if (absl::StrContains(message, words)) return absl::ResourceExhaustedError("out of memory");
    }
    return absl::InvalidArgumentError(message);
  }

  Table table;
  Owned env, memory;
};

OnnxRuntime::OnnxRuntime(std::unique_ptr<Calls> calls) : calls_(std::move(calls)) {}
OnnxRuntime::~OnnxRuntime() = default;

absl::StatusOr<std::unique_ptr<OnnxRuntime>> OnnxRuntime::Load(
    const std::filesystem::path& library) {
  // Never unloaded (RTLD_NODELETE): destructors of the library's threads may run as late as at the
  // end of the process.
  void* handle = dlopen(library.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
  if (handle == nullptr) return LoadError(library, absl::StrCat("does not load: ", dlerror()));
  const auto get_base = reinterpret_cast<const ApiBase* (*)()>(dlsym(handle, "OrtGetApiBase"));
  if (get_base == nullptr) return LoadError(library, "is not ONNX Runtime");
  const ApiBase* base = get_base();
  const Table table = base->get_api(kApiVersion);
  if (table == nullptr) {
    return LoadError(library, absl::StrCat("is ONNX Runtime ", base->get_version(),
                                           "; 1.17 or later is needed"));
  }
  auto calls = std::make_unique<Calls>(table);
  RETURN_IF_ERROR(calls->Call(kCreateEnv, kLogErrors, "pepeseg", calls->env.address()));
  RETURN_IF_ERROR(
      calls->Call(kCreateCpuMemoryInfo, kArenaAllocator, kDefaultMemory, calls->memory.address()));
  return std::unique_ptr<OnnxRuntime>(new OnnxRuntime(std::move(calls)));
}

struct OnnxSession::State {
  State(const OnnxRuntime::Calls& runtime, std::string model_name)
      : calls(runtime),
        session(runtime.table, kReleaseSession),
        run_options(runtime.table, kReleaseRunOptions),
        name(std::move(model_name)) {}

  absl::Status Named(const absl::Status& status) const {
    return absl::Status(status.code(), absl::StrCat(name, ": ", status.message()));
  }
  absl::Status Open(std::string_view model, const OnnxSessionOptions& wanted);
  absl::StatusOr<OnnxTensor> Read(Object value) const;

  const OnnxRuntime::Calls& calls;
  Owned session;
  Owned run_options;  // shared by all runs, so that one flag ends them all
  std::atomic<bool> interrupted = false;
  std::string name;
};

OnnxSession::OnnxSession(std::unique_ptr<State> state) : state_(std::move(state)) {}
OnnxSession::~OnnxSession() = default;

absl::Status OnnxSession::State::Open(std::string_view model, const OnnxSessionOptions& wanted) {
  RETURN_IF_ERROR(calls.Call(kCreateRunOptions, run_options.address()));
  Owned options(calls.table, kReleaseSessionOptions);
  RETURN_IF_ERROR(calls.Call(kCreateSessionOptions, options.address()));
  RETURN_IF_ERROR(calls.Call(kSetIntraOpNumThreads, options.get(), wanted.num_threads));
  // A memory pattern allocates the most that any run has needed, for each run. Measured: twice the
  // memory, and no less time.
  RETURN_IF_ERROR(calls.Call(kDisableMemPattern, options.get()));
  // Threads that wait must not spin: they would take processors from other programs.
  RETURN_IF_ERROR(
      calls.Call(kAddSessionConfigEntry, options.get(), "session.intra_op.allow_spinning", "0"));
  return calls.Call(kCreateSessionFromArray, calls.env.get(),
                    static_cast<const void*>(model.data()), model.size(), options.get(),
                    session.address());
}

absl::StatusOr<std::unique_ptr<OnnxSession>> OnnxSession::Create(
    const OnnxRuntime& runtime, std::string_view model, std::string name,
    const OnnxSessionOptions& options) {
  auto state = std::make_unique<State>(*runtime.calls_, std::move(name));
  const absl::Status opened = state->Open(model, options);
  if (!opened.ok()) return state->Named(opened);
  return std::unique_ptr<OnnxSession>(new OnnxSession(std::move(state)));
}

// Copies the tensor `value` out of the library's memory.
absl::StatusOr<OnnxTensor> OnnxSession::State::Read(Object value) const {
  OnnxTensor tensor;
  Owned info(calls.table, kReleaseTensorTypeAndShape);
  RETURN_IF_ERROR(calls.Call(kGetTensorTypeAndShape, value, info.address()));
  size_t rank = 0;
  RETURN_IF_ERROR(calls.Call(kGetDimensionsCount, info.get(), &rank));
  tensor.shape.resize(rank);
  RETURN_IF_ERROR(calls.Call(kGetDimensions, info.get(), tensor.shape.data(), rank));
  void* data = nullptr;
  RETURN_IF_ERROR(calls.Call(kGetTensorMutableData, value, &data));
  const auto* values = static_cast<const float*>(data);
  tensor.values.assign(values, values + NumValues(tensor.shape));
  return tensor;
}

absl::StatusOr<std::vector<OnnxTensor>> OnnxSession::Run(
    std::span<const OnnxInput> inputs, std::span<const char* const> outputs) const {
  const OnnxRuntime::Calls& calls = state_->calls;
  std::vector<Owned> owned;
  owned.reserve(inputs.size() + outputs.size());
  std::vector<const char*> names;
  std::vector<Object> values, made(outputs.size(), nullptr);
  for (const OnnxInput& input : inputs) {
    Owned& value = owned.emplace_back(calls.table, kReleaseValue);
    // The tensor borrows the values; kRun only reads them.
    RETURN_IF_ERROR(calls.Call(kCreateTensorWithData, calls.memory.get(),
                               static_cast<void*>(const_cast<float*>(input.values.data())),
                               input.values.size_bytes(), input.shape.data(), input.shape.size(),
                               kFloat, value.address()));
    names.push_back(input.name);
    values.push_back(value.get());
  }
  const absl::Status ran =
      calls.Call(kRun, state_->session.get(), state_->run_options.get(), names.data(),
                 values.data(), values.size(), outputs.data(), outputs.size(), made.data());
  for (const Object value : made) {
    *owned.emplace_back(calls.table, kReleaseValue).address() = value;
  }
  if (!ran.ok() && state_->interrupted) return absl::CancelledError(state_->name + ": interrupted");
  if (!ran.ok()) return state_->Named(ran);
  std::vector<OnnxTensor> tensors;
  for (const Object value : made) {
    ASSIGN_OR_RETURN(OnnxTensor tensor, state_->Read(value));
    tensors.push_back(std::move(tensor));
  }
  return tensors;
}

void OnnxSession::Interrupt() const {
  state_->interrupted = true;
  // This call fails only without run options, which every session has.
  state_->calls.Call(kRunOptionsSetTerminate, state_->run_options.get()).IgnoreError();
}

}  // namespace pepeseg
