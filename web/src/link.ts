// The whole set-up in the address: what stands after the # never leaves the browser.

/** What a link carries. */
export interface Shared {
  toml: string;
  robots: string[];
}

const VERSION = "1";
/** A set-up is a few kilobytes; more is not one. */
const MOST_CHARACTERS = 200_000;

async function piped(bytes: Uint8Array<ArrayBuffer>, through: CompressionStream | DecompressionStream): Promise<Uint8Array<ArrayBuffer>> {
  const stream = new Blob([bytes]).stream().pipeThrough(through);
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

export async function encode(shared: Shared): Promise<string> {
  const bytes = new TextEncoder().encode(JSON.stringify(shared));
  const packed = await piped(bytes, new CompressionStream("deflate-raw"));
  const text = btoa(String.fromCharCode(...packed));
  return `${VERSION}.${text.replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "")}`;
}

/** Reads what `encode` wrote. Throws with a reason. */
export async function decode(fragment: string): Promise<Shared> {
  const broken = "the link does not hold a set-up: it is cut off or was changed";
  const [version, text, ...rest] = fragment.split(".");
  if (version !== VERSION || text === undefined || rest.length > 0 || text.length > MOST_CHARACTERS) throw new Error(broken);
  try {
    const binary = atob(text.replaceAll("-", "+").replaceAll("_", "/"));
    const bytes = Uint8Array.from(binary, (character) => character.charCodeAt(0));
    const json = new TextDecoder().decode(await piped(bytes, new DecompressionStream("deflate-raw")));
    const { toml, robots } = JSON.parse(json) as Partial<Shared>;
    if (typeof toml !== "string" || !Array.isArray(robots) || !robots.every((name) => typeof name === "string")) {
      throw new Error(broken);
    }
    return { toml, robots };
  } catch {
    throw new Error(broken);
  }
}
