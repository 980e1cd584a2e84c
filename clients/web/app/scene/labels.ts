import { Code, ConnectError } from '@connectrpc/connect';
import type { Label } from '../../gen/pepeseg/v1/label_pb';
import { allPages, lastId, newRequestId, segmentation } from '../api/clients';
import { steadily } from '../api/server_link';
import { Store } from '../store';
import { sceneIdFrom } from '../upload/dataset_files';
import type { Answer, Mask } from './answer';

const maxTries = 20;

/** Names that look the same are the same. */
function sameName(text: string): string {
  return text.normalize('NFKC').trim().replace(/\s+/g, ' ').toLowerCase();
}

export class SceneLabels {
  readonly list = new Store<readonly Label[]>([]);

  /** `scene`: its name. */
  constructor(private readonly scene: string) {}

  async load(signal?: AbortSignal): Promise<void> {
    const all = await allPages(async (pageToken) => {
      const request = { parent: this.scene, pageToken, pageSize: 1000 };
      const page = await segmentation.listLabels(request, signal ? { signal } : {});
      return { items: page.labels, nextPageToken: page.nextPageToken };
    });
    this.list.set(all);
  }

  /** The mask that a label is made of: of the view on the screen, or where most is seen. */
  maskToName(answer: Answer | undefined, shownView: string): Mask | undefined {
    const shown = answer?.masks.get(shownView);
    if (shown && shown.area > 0) return shown;
    const seen = [...(answer?.masks.values() ?? [])].filter(({ view, area }) => view && area > 0);
    return seen.sort((a, b) => b.area - a.area)[0];
  }

  /** The label that is called so, if there is one. */
  named(text: string): Label | undefined {
    const wanted = sameName(text);
    return this.list.get().find((label) => sameName(label.text || lastId(label.name)) === wanted);
  }

  async create(text: string, { view, rle }: Mask): Promise<void> {
    const id = sceneIdFrom(text);
    for (let n = 1; ; ++n) {
      const request = {
        parent: this.scene,
        labelId: n === 1 ? id : `${id}-${n}`,
        label: { text, view, mask: { image: { case: 'rle', value: { ...rle } } as const } },
        requestId: newRequestId(),
      };
      try {
        await steadily(() => segmentation.createLabel(request));
        break;
      } catch (error) {
        // Another label has the id: names that differ may have the same letters.
        if (ConnectError.from(error).code !== Code.AlreadyExists || n === maxTries) throw error;
      }
    }
    await steadily(() => this.load());
  }

  async remove(label: Label): Promise<void> {
    await steadily(() => segmentation.deleteLabel({ name: label.name }));
    await steadily(() => this.load());
  }
}
