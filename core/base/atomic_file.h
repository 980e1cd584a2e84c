#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace pepeseg {

// A file that appears under its name whole or not at all, also over a power cut: written beside its
// place, synced, renamed over it, and the folder synced. Destroyed before Commit, it leaves nothing
// behind. Not thread safe.
class AtomicFile {
 public:
  static absl::StatusOr<AtomicFile> Create(const std::filesystem::path& path);
  AtomicFile(AtomicFile&& other) noexcept;
  AtomicFile& operator=(AtomicFile&& other) noexcept;
  ~AtomicFile();

  absl::Status Append(std::string_view bytes);
  absl::Status Append(std::span<const uint8_t> bytes);
  // Nothing may be appended afterwards.
  absl::Status Commit();

 private:
  AtomicFile(std::filesystem::path path, std::string temporary, int descriptor);
  void Discard();

  std::filesystem::path path_;
  std::string temporary_;
  int descriptor_ = -1;
};

absl::Status WriteFileAtomically(const std::filesystem::path& path, std::string_view bytes);

// Makes names created, renamed or removed in `folder` durable.
absl::Status SyncFolder(const std::filesystem::path& folder);

}  // namespace pepeseg
