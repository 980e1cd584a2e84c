import { Code, ConnectError } from '@connectrpc/connect';
import type { Label } from '../../gen/pepeseg/v1/label_service_pb';
import { allPages, labels, lastId, newRequestId } from '../api/clients';
import { steadily } from '../api/server_link';
import type { Change } from '../history';
import { History } from '../history';
import { Store } from '../store';
import { sceneIdFrom } from '../upload/scene_id';
import { acceptedMask } from './accepted_mask';
import type { Answer, Mask } from './answer';
import type { Rgb } from './found_things';
import { colorOf } from './found_things';
import type { Prompt } from './prompt';

const maxTries = 20;

/** Returns the form in which names are compared: names that look the same are equal. */
function sameName(text: string): string {
  return text.normalize('NFKC').trim().replace(/\s+/g, ' ').toLowerCase();
}

/** Returns the text of a label for people; without one, its id. */
export function labelName({ text, name }: Label): string {
  return text || lastId(name);
}

/** Returns the colour of the label that a prompt is about; undefined for other prompts. */
export function labelColor(list: readonly Label[], prompt: Prompt): Rgb | undefined {
  if (prompt.kind !== 'label') return undefined;
  const index = list.findIndex(({ name }) => name === prompt.label);
  return index < 0 ? undefined : colorOf(index);
}

export class SceneLabels {
  readonly list = new Store<readonly Label[]>([]);
  /** Number of views that show a label, by its name: of those that were shown so far. */
  readonly numViews = new Store<ReadonlyMap<string, number>>(new Map());

  /** The labels of a scene. `scene`: the scene's name. */
  constructor(
    private readonly scene: string,
    readonly history = new History(),
  ) {}

  async load(signal?: AbortSignal): Promise<void> {
    const all = await allPages(async (pageToken) => {
      const request = { parent: this.scene, pageToken, pageSize: 1000 };
      const page = await labels.listLabels(request, signal ? { signal } : {});
      return { items: page.labels, nextPageToken: page.nextPageToken };
    });
    this.list.set(all);
  }

  /** Returns the mask for a new label: that of the shown view, or else the largest one. */
  maskToName(answer: Answer | undefined, shownView: string): Mask | undefined {
    const shown = answer?.masks.get(shownView);
    if (shown && shown.area > 0) return shown;
    const seen = [...(answer?.masks.values() ?? [])].filter(({ view, area }) => view && area > 0);
    return seen.sort((a, b) => b.area - a.area)[0];
  }

  /** Returns the label with this text, if there is one. */
  named(text: string): Label | undefined {
    const wanted = sameName(text);
    return this.list.get().find((label) => sameName(labelName(label)) === wanted);
  }

  /** Keeps in how many views a label was found. */
  saw(label: string, numViews: number): void {
    if (this.numViews.get().get(label) === numViews) return;
    this.numViews.set(new Map([...this.numViews.get(), [label, numViews]]));
  }

  /** Makes a label of the mask; returns the change that this is, which is not in the history yet. */
  async create(text: string, mask: Mask): Promise<Change> {
    let made = await this.add(text, mask);
    return {
      name: `Name “${text}”`,
      undo: () => this.delete(made),
      redo: async () => {
        made = await this.add(text, mask);
      },
    };
  }

  async remove(label: Label): Promise<void> {
    const { signal } = new AbortController();
    const mask = await acceptedMask(label.name, signal);
    await this.delete(label.name);
    if (!mask) return; // nothing to make it from again
    const text = labelName(label);
    let made = label.name;
    this.history.add({
      name: `Deletion of “${text}”`,
      undo: async () => {
        made = await this.add(text, mask);
      },
      redo: () => this.delete(made),
    });
  }

  /** Returns the new label's name. */
  private async add(text: string, { view, rle }: Mask): Promise<string> {
    const id = sceneIdFrom(text);
    for (let n = 1; ; ++n) {
      const request = {
        parent: this.scene,
        labelId: n === 1 ? id : `${id}-${n}`,
        label: { text, view, mask: { image: { case: 'rle', value: { ...rle } } as const } },
        requestId: newRequestId(),
      };
      try {
        const { name } = await steadily(() => labels.createLabel(request));
        await steadily(() => this.load());
        return name;
      } catch (error) {
        // Another label has this id: different texts may give the same id.
        if (ConnectError.from(error).code !== Code.AlreadyExists || n === maxTries) throw error;
      }
    }
  }

  private async delete(name: string): Promise<void> {
    await steadily(() => labels.deleteLabel({ name }));
    await steadily(() => this.load());
  }
}
