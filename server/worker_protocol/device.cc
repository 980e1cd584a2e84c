#include "server/worker_protocol/device.h"

#include <algorithm>
#include <set>
#include <thread>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/status_macros.h"
#include "kernels/cuda_devices.h"

namespace pepeseg {
namespace {

constexpr int kMaxDevices = 1024;  // of one kind

// A word of OpenDevice, other than "auto".
struct DeviceWord {
  bool cuda = false;
  int number = 0;
  std::string numbers;  // as in the id: "", "1" or "0#1"
};

// Returns whether the text is a number below kMaxDevices, and sets `number`.
bool ReadNumber(const std::string& digits, int& number) {
  // SimpleAtoi would also accept spaces and signs.
  return digits.find_first_not_of("0123456789") == std::string::npos &&
         absl::SimpleAtoi(digits, &number) && number < kMaxDevices;
}

absl::StatusOr<DeviceWord> ReadWord(const std::string& wanted) {
  if (wanted == "cpu") return DeviceWord{};
  if (wanted == "cuda") return DeviceWord{true, 0, "0"};
  const std::pair<std::string, std::string> parts = absl::StrSplit(wanted, absl::MaxSplits(':', 1));
  const std::pair<std::string, std::string> numbers =
      absl::StrSplit(parts.second, absl::MaxSplits('#', 1));
  DeviceWord word{parts.first == "cuda", 0, parts.second};
  int logical = 0;
  const bool has_logical = absl::StrContains(wanted, '#');
  if ((word.cuda || (parts.first == "cpu" && !has_logical)) &&
      ReadNumber(numbers.first, word.number) &&
      (!has_logical || ReadNumber(numbers.second, logical))) {
    return word;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("device '", wanted, "': expected auto, cpu, cpu:N, cuda, cuda:N or cuda:N#K"));
}

// Puts `numbers` into the name of a backend, which has the number of a CUDA device only.
std::string NameOf(const Backend& backend, const std::string& numbers) {
  const std::string name = backend.name();
  const size_t details = name.find(" (");
  const std::string kind = name.substr(0, name.find(' '));
  return absl::StrCat(kind, numbers.empty() ? "" : " ", numbers, name.substr(details));
}

Device OpenCpu(int num_threads, const std::string& numbers, std::string reason) {
  std::unique_ptr<Backend> cpu = MakeCpuBackend(num_threads);
  std::string name = NameOf(*cpu, numbers);
  return {absl::StrCat("cpu", numbers.empty() ? "" : ":", numbers), std::move(name), std::move(cpu),
          std::move(reason)};
}

// Returns the words of a list for OpenDevices.
absl::StatusOr<std::vector<std::string>> WordsOf(const std::string& list) {
  if (list == "all") {
    std::vector<std::string> words;
    for (int i = 0; i < NumCudaDevices(); ++i) words.push_back(absl::StrCat("cuda:", i));
    if (words.empty()) words.emplace_back("auto");  // which knows why there are none
    return words;
  }
  std::vector<std::string> words = absl::StrSplit(list, ',');
  std::set<std::string> seen;
  for (const std::string& word : words) {
    if (words.size() > 1 && (word == "auto" || word == "all")) {
      return absl::InvalidArgumentError(
          absl::StrCat("devices '", list, "': ", word, " must be alone"));
    }
    if (!seen.insert(word == "cuda" ? "cuda:0" : word).second) {
      return absl::InvalidArgumentError(
          absl::StrCat("devices '", list, "': ", word, " is there twice"));
    }
  }
  return words;
}

}  // namespace

absl::StatusOr<Device> OpenDevice(const std::string& wanted, int num_threads) {
  const bool automatic = wanted == "auto";
  ASSIGN_OR_RETURN(const DeviceWord word, ReadWord(automatic ? "cuda" : wanted));
  if (!word.cuda) return OpenCpu(num_threads, word.numbers, "");
  std::string error;
  std::unique_ptr<Backend> cuda = MakeCudaBackend({.device = word.number}, &error);
  if (cuda != nullptr) {
    std::string name = NameOf(*cuda, word.numbers);
    return Device{absl::StrCat("cuda:", word.numbers), std::move(name), std::move(cuda), ""};
  }
  if (automatic) return OpenCpu(num_threads, "", std::move(error));
  return absl::FailedPreconditionError(absl::StrCat("device ", wanted, ": ", error));
}

absl::StatusOr<std::vector<Device>> OpenDevices(const std::string& list, int num_threads) {
  ASSIGN_OR_RETURN(const std::vector<std::string> words, WordsOf(list));
  const int threads = ThreadsOfDevice(num_threads, static_cast<int>(words.size()));
  std::vector<Device> devices;
  for (const std::string& word : words) {
    ASSIGN_OR_RETURN(Device device, OpenDevice(word, threads));
    devices.push_back(std::move(device));
  }
  return devices;
}

int ThreadsOfDevice(int num_threads, int num_devices) {
  if (num_threads > 0 || num_devices <= 1) return num_threads;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()) / num_devices);
}

std::optional<int> CudaDevice(const std::string& id) {
  const absl::StatusOr<DeviceWord> word = ReadWord(id);
  return word.ok() && word->cuda ? std::optional(word->number) : std::nullopt;
}

std::string KindOfDevice(const std::string& name) {
  const size_t details = name.find(" (");
  if (details == std::string::npos) return name;
  return name.substr(0, name.find(' ')) + name.substr(details);
}

}  // namespace pepeseg
