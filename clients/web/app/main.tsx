import type { JSX } from 'preact';
import { render } from 'preact';
import { AwayBanner } from './components/away_banner';
import { useRoute } from './router';
import { EarlyClicksScreen } from './screens/early_clicks_screen';
import { NewSceneScreen } from './screens/new_scene_screen';
import { SceneScreen } from './screens/scene_screen';
import { ScenesScreen } from './screens/scenes_screen';
import { TrainingScreen } from './screens/training_screen';
import { UploadScreen } from './screens/upload_screen';
import './styles/base.css';
import './styles/controls.css';
import './styles/dialog.css';
import './styles/panel.css';
import './styles/photo.css';
import './styles/screens.css';
import './styles/training.css';
import './styles/workbench.css';
import { resumeUploads } from './upload/uploads';

function Screen(): JSX.Element {
  const route = useRoute();
  switch (route.screen) {
    case 'new':
      return <NewSceneScreen />;
    case 'upload':
      return <UploadScreen key={route.upload} uploadId={route.upload} />;
    case 'scene':
      return <SceneScreen key={route.scene} sceneId={route.scene} />;
    case 'clicks':
      return <EarlyClicksScreen key={route.job} jobId={route.job} />;
    case 'training':
      return <TrainingScreen key={route.job} jobId={route.job} />;
    default:
      return <ScenesScreen />;
  }
}

function App(): JSX.Element {
  return (
    <>
      <AwayBanner />
      <Screen />
    </>
  );
}

const root = document.getElementById('app');
if (root) render(<App />, root);
void resumeUploads();
