#include "tests/system/fuzz/small_model.h"

#include <utility>

#include "core/formats/rle.h"
#include "tests/system/fuzz/fuzz_target.h"
#include "tests/testing/front_blobs.h"

namespace pepeseg::fuzz {
namespace {

constexpr int kSide = 32;

Model ThreeViews() {
  Model model = testing::PairOfBlobs(kSide);
  ModelView view = model.views.front();
  view.name = "left/0.jpg";
  view.held_out = true;
  model.views.push_back(view);
  view.name = "middle.jpg";
  model.views.push_back(view);
  return model;
}

LabelRecord RedLabel(const SceneRef& scene) {
  LabelRecord label;
  label.scene = scene;
  label.id = "red";
  label.view = "front";
  label.width = label.height = kSide;
  BinaryMask mask{std::vector<uint8_t>(size_t{kSide} * kSide, 1)};
  label.counts = EncodeCocoRle(mask, kSide, kSide);
  label.area = int64_t{kSide} * kSide;
  return label;
}

}  // namespace

SmallModel::SmallModel() : backend_(MakeCpuBackend(1)) {
  auto model = SceneModel::Create(*backend_, ThreeViews());
  Expect(model.ok(), "a model");
  model_ = *std::move(model);
  auto store = Store::Open("sqlite:" + (folder_ / "store.db").string());
  Expect(store.ok(), "a store");
  store_ = *std::move(store);
  const auto scene = store_->scenes().CreateScene({{0, kDefaultProject, "shelf"}, "", "", {}});
  Expect(scene.ok(), "a scene");
  scene_ = scene->scene;
  Expect(store_->labels().CreateLabel(RedLabel(scene_)).ok(), "a label");
}

}  // namespace pepeseg::fuzz
