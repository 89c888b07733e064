/** The comparison or the diagnosis as one offline HTML file, which was written with it. */

export function SaveReport({ of, made }: { of: "comparison" | "diagnosis"; made: boolean }) {
  return (
    <section class="card" aria-label={`Report of the ${of}`}>
      <div class="block-head">
        <span class="dim">The {of} as one HTML file that needs no network.</span>
        {made ? (
          <a class="link" href={`/report?name=${of}`} download>
            Save as report
          </a>
        ) : (
          <span class="dim">There is none yet: it is made with the next {of}.</span>
        )}
      </div>
    </section>
  );
}
