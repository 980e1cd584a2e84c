#include "server/rpc/reflection.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>

#include <memory>
#include <utility>
#include <vector>

namespace pepeseg {
namespace {

using Plugin = grpc::reflection::ProtoServerReflectionPlugin;

class ReflectionOption : public grpc::ServerBuilderOption {
 public:
  explicit ReflectionOption(bool served) : served_(served) {}

  void UpdateArguments(grpc::ChannelArguments*) override {}
  void UpdatePlugins(std::vector<std::unique_ptr<grpc::ServerBuilderPlugin>>* plugins) override {
    auto own = std::make_unique<Plugin>();
    std::erase_if(*plugins, [&](const auto& plugin) { return plugin->name() == own->name(); });
    if (served_) plugins->push_back(std::move(own));
  }

 private:
  const bool served_;
};

}  // namespace

void SetReflection(grpc::ServerBuilder& builder, bool served) {
  builder.SetOption(std::make_unique<ReflectionOption>(served));
}

}  // namespace pepeseg
