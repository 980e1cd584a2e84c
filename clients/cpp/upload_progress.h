#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace pepeseg::client {

// What an upload tells on its way; either may be empty. Called by the thread that uploads.
struct UploadProgress {
  std::function<void(int64_t num_there, int64_t num_bytes)> bytes;
  std::function<void(const std::string& what)> note;  // broken off and tried again, all there
};

}  // namespace pepeseg::client
