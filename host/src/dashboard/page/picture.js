// Figures of the server: the drawing that came with the data at once, alive when it is looked at.
const shownFigures=new Map(); // host element → address that it shows
// puts the figure of an address into an element; the same address again only if it may have changed
async function picture(host,path,again=false){
  if(shownFigures.get(host)===path&&!again)return;
  shownFigures.set(host,path);
  const answer=await ask(path);
  if(shownFigures.get(host)!==path||!host.isConnected)return;
  if(!answer){host.replaceChildren(Object.assign(document.createElement('p'),{className:'absent',textContent:'No data for this figure yet.'}));return}
  const views=keepViews(answer.figure.name);
  alive.delete(answer.figure.name);
  // markup of ours, in which every name from a file was escaped by the program
  const made=new DOMParser().parseFromString(answer.html,'text/html').body.firstElementChild;
  host.replaceChildren(document.adoptNode(made));
  const charts=enliven(made,answer.figure);
  views.forEach((view,i)=>{const chart=charts[i];if(view&&chart instanceof Chart)chart.zoom(view)});
  keysOf(made,answer.figure);
}
// a zoom stays while new data come
function keepViews(name){
  const same=(a,b)=>a[0]===b[0]&&a[1]===b[1];
  return(alive.get(name)||[]).map(c=>c instanceof Chart&&!(same(c.view.x,c.panel.x.range)&&same(c.view.y,c.panel.y.range))?{x:c.view.x,y:c.view.y}:null);
}
