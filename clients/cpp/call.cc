#include "clients/cpp/call.h"

#include <chrono>

namespace pepeseg::client {

Call::Call(const std::string& scene, double seconds) {
  const std::string name = SceneName(scene);
  if (!scene.empty()) context_.AddMetadata("x-scene", name.substr(name.rfind('/') + 1));
  if (seconds > 0) {
    context_.set_deadline(std::chrono::system_clock::now() +
                          std::chrono::milliseconds(static_cast<int64_t>(seconds * 1000)));
  }
}

}  // namespace pepeseg::client
