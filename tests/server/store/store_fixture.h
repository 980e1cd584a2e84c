#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "server/store/store.h"
#include "tests/server/store/scene_of.h"
#include "tests/server/store/test_database.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {

// An empty store that a test can close and open again.
class StoreTest : public ::testing::Test {
 protected:
  StoreTest() : url_(testing::NewTestDatabase(folder_.path())) { Reopen(); }

  void Reopen() {
    store_.reset();
    auto store = Store::Open(url_);
    ASSERT_OK(store);
    store_ = std::move(store).value();
  }

  void MakeScene(const std::string& id) {
    ASSERT_OK(store_->scenes().CreateScene(NewScene(id, "Name of " + id, "")));
  }

  // Creates a scene with the sealed dataset 1.
  void MakeTrainable(const std::string& id) {
    MakeScene(id);
    ASSERT_OK(store_->datasets().CreateDataset(SceneOf(*store_, id), "",
                                               {{"images/a.jpg", 1, 3, "00", true}}));
    ASSERT_OK(store_->datasets().SealDataset(SceneOf(*store_, id), 1));
  }

  absl::StatusOr<JobRecord> Train(const std::string& scene, const std::string& request_id = "") {
    JobRecord job;
    job.scene = SceneOf(*store_, scene);
    job.dataset = 1;
    job.options = std::string("\0opt\xff", 5);
    job.effective_options = "effective";
    job.request_id = request_id;
    return store_->jobs().CreateJob(job);
  }

  testing::TempFolder folder_;
  std::string url_;
  std::unique_ptr<Store> store_;
};

}  // namespace pepeseg
