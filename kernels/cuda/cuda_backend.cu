#include <cuda_runtime.h>

#include <algorithm>
#include <utility>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda_devices.h"

// Host side of the CUDA backend: set-up, errors, copies, readbacks, recorded sequences and the
// timing of kernels. Memory is in memory.cu. Threads, streams and graphs are described in
// cuda_backend.h.

namespace pepeseg {

// Sets up the device. After an error the rest fails as well; the first error is kept, and
// MakeCudaBackend reports it.
CudaBackend::CudaBackend(const CudaOptions& options, std::shared_ptr<CudaMemoryUse> use,
                         int stream_priority)
    : options_(options),
      use_(use != nullptr ? std::move(use) : std::make_shared<CudaMemoryUse>()),
      stream_priority_(stream_priority) {
  Keep(cudaSetDevice(options.device), "setting the device");
  cudaDeviceProp properties = {};
  Keep(cudaGetDeviceProperties(&properties, options.device),
       "reading the properties of the device");
  device_name_ = properties.name;
  OpenStream(stream_);
  OpenStream(side_stream_);
  for (cudaEvent_t& event : readbacks_) {
    Keep(cudaEventCreateWithFlags(&event, cudaEventDisableTiming), "creating an event");
  }
  Keep(cudaMallocHost(reinterpret_cast<void**>(&pinned_counters_),
                      kNumCudaCounters * sizeof(int64_t)),
       "allocating pinned memory");
  // The pool keeps freed memory: otherwise a scene that grows and shrinks would call the driver
  // each time.
  cudaMemPool_t pool;
  uint64_t keep_all = UINT64_MAX;
  Keep(cudaDeviceGetDefaultMemPool(&pool, options.device), "getting the memory pool");
  Keep(cudaMemPoolSetAttribute(pool, cudaMemPoolAttrReleaseThreshold, &keep_all),
       "setting up the memory pool");
}

// Waits for the stream before anything that its work may use is destroyed.
CudaBackend::~CudaBackend() {
  cudaSetDevice(options_.device);  // this thread may have made another device current
  for (Buffer<std::byte>& temporary : temporary_) temporary = {};
  if (stream_ != nullptr) cudaStreamSynchronize(stream_);
  for (const KernelMark& mark : marks_) cudaEventDestroy(mark.event);
  for (const cudaEvent_t event : readbacks_) {
    if (event != nullptr) cudaEventDestroy(event);
  }
  if (pinned_counters_ != nullptr) cudaFreeHost(pinned_counters_);
  for (const auto& [key, sequence] : sequences_) cudaGraphExecDestroy(sequence);
  for (const cudaEvent_t event : branch_ends_) {
    if (event != nullptr) cudaEventDestroy(event);
  }
  for (const cudaStream_t branch : branch_streams_) {
    if (branch != nullptr) cudaStreamDestroy(branch);
  }
  if (side_stream_ != nullptr) cudaStreamDestroy(side_stream_);
  if (stream_ != nullptr) cudaStreamDestroy(stream_);
}

// Returns none if kernels are timed: each time is that between two events of this backend, and
// would hold kernels of the twin.
std::unique_ptr<Backend> CudaBackend::MakeTwin(QueuePriority priority) const {
  if (options_.kernel_times != nullptr) return nullptr;
  int stream_priority = stream_priority_, lowest = 0, highest = 0;
  // Without an answer both are 0: all streams are alike.
  if (priority == QueuePriority::kFirst &&
      cudaDeviceGetStreamPriorityRange(&lowest, &highest) == cudaSuccess) {
    stream_priority = highest;
  }
  auto twin = std::make_unique<CudaBackend>(options_, use_, stream_priority);
  if (!twin->error().empty()) return nullptr;
  return twin;
}

CudaBackend::Turn::Turn(CudaBackend& backend) : lock_(backend.mutex_) {
  usable_ = backend.error_.empty();
  if (usable_) {
    // Each host thread has a current device of its own.
    backend.Keep(cudaSetDevice(backend.options_.device), "setting the device");
    if (backend.options_.kernel_times != nullptr) backend.Launched(nullptr);
  }
}

std::string CudaBackend::name() const {
  return "cuda " + std::to_string(options_.device) + " (" + device_name_ + ")";
}

std::string CudaBackend::error() const {
  const std::lock_guard lock(mutex_);
  return error_;
}

void CudaBackend::Sync() {
  const Turn turn(*this);
  if (!turn) return;
  Keep(cudaStreamSynchronize(stream_), "waiting for the device");
  if (options_.kernel_times != nullptr) ReadKernelTimes();
}

void CudaBackend::Keep(cudaError_t error, const char* doing) {
  if (error == cudaSuccess) return;
  cudaGetLastError();  // clears it: otherwise the next launch would report it again
  Fail({std::string("CUDA: ") + doing + ": " + cudaGetErrorString(error),
        error != cudaErrorMemoryAllocation});
}

void CudaBackend::Fail(BackendError error) {
  if (!error_.empty() && (fatal_ || !error.fatal)) return;
  error_ = std::move(error.what);
  fatal_ = error.fatal;
}

BackendError CudaBackend::TakeError() {
  const std::lock_guard lock(mutex_);
  if (fatal_) return {error_, true};
  cudaSetDevice(options_.device);
  // A fault within a kernel shows only when the host waits for it. Waiting also when memory ran out
  // keeps such a fault from being attributed to the next owner of the backend.
  Keep(cudaStreamSynchronize(stream_), "waiting for the device");
  BackendError error = {error_, fatal_};
  if (!fatal_) error_.clear();
  return error;
}

void CudaBackend::Launched(const char* kernel) {
  Keep(cudaGetLastError(), kernel);
  if (options_.kernel_times == nullptr) return;
  cudaEvent_t event;
  Keep(cudaEventCreate(&event), "creating an event");
  Keep(cudaEventRecord(event, stream_), "recording an event");
  marks_.push_back({kernel, event});
}

void CudaBackend::ReadKernelTimes() {
  // The first mark is always the begin of an op, so there is a mark before each kernel's.
  std::vector<KernelTime>& times = *options_.kernel_times;
  for (size_t i = 1; i < marks_.size(); ++i) {
    if (marks_[i].kernel == nullptr) continue;
    float ms = 0;
    Keep(cudaEventElapsedTime(&ms, marks_[i - 1].event, marks_[i].event), "timing a kernel");
    const auto is_this = [&](const KernelTime& time) { return time.name == marks_[i].kernel; };
    auto found = std::find_if(times.begin(), times.end(), is_this);
    if (found == times.end()) found = times.insert(found, {marks_[i].kernel, 0, 0});
    found->ms += ms;
    ++found->calls;
  }
  for (const KernelMark& mark : marks_) cudaEventDestroy(mark.event);
  marks_.clear();
}

void* CudaBackend::Temporary(size_t num_bytes) {
  temporary_[branch_].Reserve(*this, static_cast<int64_t>(num_bytes));
  return temporary_[branch_].span().data;
}

// Returns when pageable `from_host` has been staged by the driver, possibly before it has arrived.
void CudaBackend::CopyFromHost(void* to, const void* from_host, size_t num_bytes) {
  const Turn turn(*this);
  if (!turn) return;
  Keep(cudaMemcpyAsync(to, from_host, num_bytes, cudaMemcpyHostToDevice, stream_),
       "copying to the device");
}

void CudaBackend::CopyToHost(void* to_host, const void* from, size_t num_bytes) {
  const Turn turn(*this);
  if (!turn) return;
  Keep(cudaMemcpyAsync(to_host, from, num_bytes, cudaMemcpyDeviceToHost, stream_),
       "copying from the device");
  Keep(cudaStreamSynchronize(stream_), "waiting for the device");
}

void CudaBackend::Copy(void* to, const void* from, size_t num_bytes) {
  const Turn turn(*this);
  if (!turn) return;
  Keep(cudaMemcpyAsync(to, from, num_bytes, cudaMemcpyDeviceToDevice, stream_),
       "copying on the device");
}

void CudaBackend::Zero(void* data, size_t num_bytes) {
  const Turn turn(*this);
  if (!turn) return;
  Keep(cudaMemsetAsync(data, 0, num_bytes, stream_), "zeroing");
}

// Captures the launches of `ops` instead of running them, and then launches them as one graph. Only
// this thread can launch on the stream meanwhile, as it holds the mutex. The ops are captured on
// each call, because pointers, sizes and other arguments change from step to step. An op that waits
// on the host would invalidate the capture, which is a fatal error.
void CudaBackend::Sequence(int key, const std::function<void()>& ops) {
  const Turn turn(*this);
  if (!turn) return;
  if (options_.kernel_times != nullptr) return ops();
  Keep(cudaStreamBeginCapture(stream_, cudaStreamCaptureModeRelaxed), "recording a sequence");
  if (!error_.empty()) return;
  recording_ = true;
  ops();
  recording_ = false;
  cudaGraph_t graph = nullptr;
  Keep(cudaStreamEndCapture(stream_, &graph), "recording a sequence");
  if (error_.empty()) LaunchSequence(key, graph);
  if (graph != nullptr) cudaGraphDestroy(graph);
  // The graph may use this memory: it is freed behind the launch.
  for (void* data : freed_while_recording_) Keep(cudaFreeAsync(data, stream_), "freeing");
  freed_while_recording_.clear();
}

// Creates a stream with the priority of this backend.
void CudaBackend::OpenStream(cudaStream_t& stream) {
  Keep(cudaStreamCreateWithPriority(&stream, cudaStreamNonBlocking, stream_priority_),
       "creating a stream");
}

// Creates the stream and the event of a branch where they do not exist yet.
void CudaBackend::OpenBranch(int branch) {
  if (branch > 0 && branch_streams_[branch] == nullptr) {
    OpenStream(branch_streams_[branch]);
  }
  if (branch_ends_[branch] == nullptr) {
    Keep(cudaEventCreateWithFlags(&branch_ends_[branch], cudaEventDisableTiming),
         "creating an event");
  }
}

// Captures part k on the stream of branch k. All branches begin where the calls before have ended,
// and the stream of the calls waits for their ends. More parts than branches take turns: a part
// follows the one before it on the same branch.
void CudaBackend::Branches(std::span<const std::function<void()>> parts) {
  const Turn turn(*this);
  if (!turn) return;
  if (!recording_ || branch_ > 0 || parts.size() < 2) {
    for (const auto& part : parts) part();
    return;
  }
  const int num_branches = std::min<int>(static_cast<int>(parts.size()), kMaxBranches);
  for (int branch = 0; branch < num_branches; ++branch) OpenBranch(branch);
  if (!error_.empty()) return;
  const cudaStream_t trunk = stream_;
  Keep(cudaEventRecord(branch_ends_[0], trunk), "recording an event");
  for (int branch = 1; branch < num_branches; ++branch) {
    Keep(cudaStreamWaitEvent(branch_streams_[branch], branch_ends_[0]), "beginning a branch");
  }
  for (size_t k = 0; k < parts.size(); ++k) {
    branch_ = static_cast<int>(k) % num_branches;
    stream_ = branch_ == 0 ? trunk : branch_streams_[branch_];
    parts[k]();
  }
  branch_ = 0;
  stream_ = trunk;
  for (int branch = 1; branch < num_branches; ++branch) {
    Keep(cudaEventRecord(branch_ends_[branch], branch_streams_[branch]), "recording an event");
    Keep(cudaStreamWaitEvent(trunk, branch_ends_[branch]), "ending a branch");
  }
}

// Updates the executable graph of this key with the arguments of `graph`, which is cheaper than
// making a new one, and launches it. A graph that still runs is not affected: updates apply to
// later launches, and a destroyed graph is freed when it has run.
void CudaBackend::LaunchSequence(int key, cudaGraph_t graph) {
  cudaGraphExec_t& sequence = sequences_[key];
  cudaGraphExecUpdateResultInfo result;
  // An update fails when the number of kernels changes, as with the passes of a sort.
  if (sequence != nullptr && cudaGraphExecUpdate(sequence, graph, &result) != cudaSuccess) {
    cudaGetLastError();
    cudaGraphExecDestroy(sequence);
    sequence = nullptr;
  }
  if (sequence == nullptr) Keep(cudaGraphInstantiate(&sequence, graph, 0), "instantiating a graph");
  if (sequence != nullptr) Keep(cudaGraphLaunch(sequence, stream_), "launching a graph");
}

int64_t CudaBackend::CopyToHostLater(void* to_pinned, const void* from, size_t num_bytes) {
  const Turn turn(*this);
  const int64_t ticket = num_readbacks_++;  // also after an error: the caller counts tickets
  if (!turn) return ticket;
  Keep(cudaMemcpyAsync(to_pinned, from, num_bytes, cudaMemcpyDeviceToHost, stream_),
       "copying from the device");
  Keep(cudaEventRecord(readbacks_[ticket % kMaxReadbacks], stream_), "recording an event");
  return ticket;
}

// Waits without the mutex, so that other threads can keep launching.
void CudaBackend::WaitFor(int64_t ticket) {
  cudaEvent_t event;
  {
    const Turn turn(*this);
    if (!turn) return;
    event = readbacks_[ticket % kMaxReadbacks];
  }
  const cudaError_t error = cudaEventSynchronize(event);
  const std::lock_guard lock(mutex_);
  Keep(error, "waiting for the device");
}

int NumCudaDevices() {
  int num_devices = 0;
  if (cudaGetDeviceCount(&num_devices) == cudaSuccess) return num_devices;
  cudaGetLastError();
  return 0;
}

std::unique_ptr<Backend> MakeCudaBackend(const CudaOptions& options, std::string* error) {
  int num_devices = 0;
  const cudaError_t found = cudaGetDeviceCount(&num_devices);
  if (found != cudaSuccess) {
    cudaGetLastError();
    *error = std::string("no CUDA device: ") + cudaGetErrorString(found);
    return nullptr;
  }
  if (options.device < 0 || options.device >= num_devices) {
    *error = "no CUDA device " + std::to_string(options.device) + ": there are " +
             std::to_string(num_devices);
    return nullptr;
  }
  auto backend = std::make_unique<CudaBackend>(options);
  *error = backend->error();
  if (!error->empty()) return nullptr;
  return backend;
}

}  // namespace pepeseg
