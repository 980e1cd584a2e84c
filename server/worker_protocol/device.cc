#include "server/worker_protocol/device.h"

#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr int kMaxCudaDevices = 1024;

// Returns N for "cuda:N", and 0 for "cuda". INVALID_ARGUMENT: another word.
absl::StatusOr<int> CudaIndex(const std::string& wanted) {
  if (wanted == "cuda") return 0;
  int index = -1;
  const std::string digits = wanted.starts_with("cuda:") ? wanted.substr(5) : "";
  // SimpleAtoi would also accept spaces and signs.
  if (digits.find_first_not_of("0123456789") == std::string::npos &&
      absl::SimpleAtoi(digits, &index) && index < kMaxCudaDevices) {
    return index;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("device '", wanted, "': expected auto, cpu, cuda or cuda:N"));
}

Device OpenCpu(int num_threads, std::string reason) {
  return {"cpu", MakeCpuBackend(num_threads), std::move(reason)};
}

}  // namespace

absl::StatusOr<Device> OpenDevice(const std::string& wanted, int num_threads) {
  if (wanted == "cpu") return OpenCpu(num_threads, "");
  const bool automatic = wanted == "auto";
  ASSIGN_OR_RETURN(const int index, CudaIndex(automatic ? "cuda" : wanted));
  std::string error;
  std::unique_ptr<Backend> cuda = MakeCudaBackend({.device = index}, &error);
  if (cuda != nullptr) return Device{absl::StrCat("cuda:", index), std::move(cuda), ""};
  if (automatic) return OpenCpu(num_threads, std::move(error));
  return absl::FailedPreconditionError(absl::StrCat("device ", wanted, ": ", error));
}

std::optional<int> CudaDevice(const std::string& id) {
  const absl::StatusOr<int> index = CudaIndex(id);
  return index.ok() ? std::optional(*index) : std::nullopt;
}

}  // namespace pepeseg
